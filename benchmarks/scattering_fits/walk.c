/* Photons walked one by one: an independent source of scattered light, which shares nothing with the package.

   A Gaussian lamp, an apparent source z0 behind a window at z = 0, unbounded water beyond it, Henyey-Greenstein
   scattering. Every photon is followed through real collisions; absorption is a weight. Counted is the power of
   scattered light that crosses planes forward, in rings about the axis, for unit intensity on the axis.

   walk PHOTONS SEED HWHM_DEG Z0_M A B G HALF_WIDTH_M N_Z Z... N_R R...   prints rows of z, r, E, standard error */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { ANGLES = 200000, BATCHES = 20, PLANES = 32, RINGS = 64 };
static uint64_t state[4];
static double tally[BATCHES][PLANES][RINGS], cumulated[ANGLES + 1];

static uint64_t rotated(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }

/* xoshiro256** of Blackman and Vigna (2018) */
static double uniform(void) {
    uint64_t r = rotated(state[1] * 5, 7) * 9, t = state[1] << 17;
    state[2] ^= state[0]; state[3] ^= state[1]; state[1] ^= state[2]; state[0] ^= state[3];
    state[2] ^= t; state[3] = rotated(state[3], 45);
    return ((r >> 11) + 0.5) / 9007199254740992.0;
}

static void seed(uint64_t s) {
    for (int i = 0; i < 4; i++) {
        uint64_t z = (s += 0x9E3779B97F4A7C15ULL);
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
        z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
        state[i] = z ^ (z >> 31);
    }
}

int main(int count, char **v) {
    if (count < 12) return 2;
    long photons = (long)atof(v[1]);
    seed((uint64_t)atoi(v[2]));
    double h = atof(v[3]) * M_PI / 180, z0 = atof(v[4]), a = atof(v[5]), b = atof(v[6]), g = atof(v[7]);
    double half = atof(v[8]), planes[PLANES], rings[RINGS];
    int n_z = atoi(v[9]), n_r = atoi(v[10 + n_z]);
    for (int i = 0; i < n_z; i++) planes[i] = atof(v[10 + i]);
    for (int i = 0; i < n_r; i++) rings[i] = atof(v[11 + n_z + i]);
    double step = 0.5 * M_PI / ANGLES;
    for (int i = 0; i < ANGLES; i++) {
        double t = (i + 0.5) * step;
        cumulated[i + 1] = cumulated[i] + exp(-M_LN2 * t * t / h / h) * sin(t) * step;
    }
    double power = 2 * M_PI * cumulated[ANGLES], reach = rings[n_r - 1] + half, far = planes[n_z - 1];
    int bins = (int)(reach / 0.001) + 2, *ring_of = malloc(bins * sizeof(int));
    for (int i = 0; i < bins; i++) {
        ring_of[i] = -1;
        for (int k = 0; k < n_r; k++)
            if (fabs((i + 0.5) * 0.001 - rings[k]) < half) ring_of[i] = k;
    }
    for (long n = 0; n < photons; n++) {
        double u = uniform() * cumulated[ANGLES];
        int low = 0, high = ANGLES;
        while (high - low > 1) {
            int middle = (low + high) / 2;
            if (cumulated[middle] <= u) low = middle; else high = middle;
        }
        double t = (low + (u - cumulated[low]) / (cumulated[high] - cumulated[low])) * step;
        double phi = 2 * M_PI * uniform(), dx = sin(t) * cos(phi), dy = sin(t) * sin(phi), dz = cos(t);
        if (dz < 1e-4) continue;
        double x = z0 * dx / dz, y = z0 * dy / dz, z = 0, length = 0;
        for (int scatterings = 0;; scatterings++) {
            double d = -log(uniform()) / b;
            for (int i = 0; scatterings && dz > 0 && i < n_z; i++) {
                double to = (planes[i] - z) / dz;
                if (to <= 0 || to > d) continue;
                double r = hypot(x + to * dx, y + to * dy);
                int k = r < reach ? ring_of[(int)(r / 0.001)] : -1;
                if (k >= 0) tally[n % BATCHES][i][k] += exp(-a * (length + to));
            }
            x += d * dx; y += d * dy; z += d * dz; length += d;
            if (z < 0 || (z > far && dz >= 0) || a * length > 30 || x * x + y * y > 400) break;
            double w = uniform(), f = (1 - g * g) / (1 - g + 2 * g * w);
            double cosine = fmin(1, fmax(-1, (1 + g * g - f * f) / (2 * g))), sine = sqrt(1 - cosine * cosine);
            double turn = 2 * M_PI * uniform(), p = cos(turn), q = sin(turn), ux, uy, uz;
            if (fabs(dz) > 0.99999) {
                ux = sine * p; uy = sine * q; uz = dz > 0 ? cosine : -cosine;
            } else {
                double m = sqrt(1 - dz * dz);
                ux = sine * (dx * dz * p - dy * q) / m + dx * cosine;
                uy = sine * (dy * dz * p + dx * q) / m + dy * cosine;
                uz = -sine * p * m + dz * cosine;
            }
            dx = ux; dy = uy; dz = uz;
        }
    }
    for (int i = 0; i < n_z; i++)
        for (int k = 0; k < n_r; k++) {
            double inner = fmax(0, rings[k] - half), outer = rings[k] + half, mean = 0, square = 0;
            double area = M_PI * (outer * outer - inner * inner);
            for (int j = 0; j < BATCHES; j++) {
                double e = tally[j][i][k] * BATCHES / photons * power / area;
                mean += e / BATCHES; square += e * e / BATCHES;
            }
            printf("%g,%g,%.7g,%.2g\n", planes[i], rings[k], mean, sqrt((square - mean * mean) / (BATCHES - 1)));
        }
    return 0;
}
