/* Photons walked one by one: an independent source of scattered light, which shares nothing with the package.

   A Gaussian lamp, an apparent source z0 behind a window at z = 0, Henyey-Greenstein scattering; beyond the window
   unbounded water, or a box of it with the lamp's axis in its middle, whose six walls reflect after Lambert. Every
   photon is followed through real collisions; absorption is a weight, one for every coefficient asked for. Counted is
   the power of light that scattered or was reflected and crosses planes forward, for unit intensity on the axis: in
   rings about it, or in a box in cells left and right of it, twice HALF_WIDTH wide and twice HALF_HEIGHT high.

   walk PHOTONS SEED HWHM_DEG Z0_M B G HALF_WIDTH_M N_A A... N_Z Z... N_R R...
       [HALF_HEIGHT WIDTH HEIGHT BACK END ALBEDO]
   prints rows of z, r, and E, standard error for every a; the box reaches from BACK (below 0) to END in z. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { ANGLES = 200000, BATCHES = 20, WATERS = 8, PLANES = 32, RINGS = 64 };
static uint64_t state[4];
static double tally[BATCHES][WATERS][PLANES][RINGS], cumulated[ANGLES + 1];

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

/* Numbers of the command line, one after the other; lists begin with their length. */
static char **next;
static double number(void) { return *next ? atof(*next++) : 0; }
static int list(double *out) {
    int n = (int)number();
    for (int i = 0; i < n; i++) out[i] = number();
    return n;
}

int main(int count, char **v) {
    if (count < 13) return 2;
    next = v + 1;
    long photons = (long)number();
    seed((uint64_t)number());
    double h = number() * M_PI / 180, z0 = number(), b = number(), g = number(), half = number();
    double waters[WATERS], planes[PLANES], rings[RINGS], first[3], last[3];
    int n_a = list(waters), n_z = list(planes), n_r = list(rings), box = *next != NULL;
    double half_height = number(), width = number(), height = number();
    first[0] = -0.5 * width, first[1] = -0.5 * height, first[2] = number();
    last[0] = 0.5 * width, last[1] = 0.5 * height, last[2] = number();
    double albedo = number(), least = waters[0];
    for (int i = 1; i < n_a; i++) least = fmin(least, waters[i]);
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
            double d = -log(uniform()) / b, p[3] = {x, y, z}, u[3] = {dx, dy, dz};
            int wall = -1;
            for (int k = 0; box && k < 3; k++) {
                double to = u[k] ? ((u[k] > 0 ? last[k] : first[k]) - p[k]) / u[k] : d;
                if (to < d) { d = fmax(0, to); wall = k; }
            }
            for (int i = 0; scatterings && dz > 0 && i < n_z; i++) {
                double to = (planes[i] - z) / dz;
                if (to <= 0 || to > d) continue;
                double px = x + to * dx, py = y + to * dy, r = box ? fabs(px) : hypot(px, py);
                int k = r < reach && (!box || fabs(py) < half_height) ? ring_of[(int)(r / 0.001)] : -1;
                for (int j = 0; k >= 0 && j < n_a; j++)
                    tally[n % BATCHES][j][i][k] += exp(-waters[j] * (length + to));
            }
            x += d * dx; y += d * dy; z += d * dz; length += d;
            if (least * length > 30 || (!box && (z < 0 || (z > far && dz >= 0) || x * x + y * y > 400))) break;
            if (wall >= 0) {
                if (uniform() >= albedo) break;
                double in = u[wall] > 0 ? -1 : 1, square = uniform(), turn = 2 * M_PI * uniform();
                p[0] = x, p[1] = y, p[2] = z;
                p[wall] = in < 0 ? last[wall] : first[wall];
                u[wall] = in * sqrt(1 - square);
                u[(wall + 1) % 3] = sqrt(square) * cos(turn), u[(wall + 2) % 3] = sqrt(square) * sin(turn);
                x = p[0], y = p[1], z = p[2], dx = u[0], dy = u[1], dz = u[2];
                continue;
            }
            double w = uniform(), f = (1 - g * g) / (1 - g + 2 * g * w);
            double cosine = fmin(1, fmax(-1, (1 + g * g - f * f) / (2 * g))), sine = sqrt(1 - cosine * cosine);
            double turn = 2 * M_PI * uniform(), cp = cos(turn), sp = sin(turn), ux, uy, uz;
            if (fabs(dz) > 0.99999) {
                ux = sine * cp; uy = sine * sp; uz = dz > 0 ? cosine : -cosine;
            } else {
                double m = sqrt(1 - dz * dz);
                ux = sine * (dx * dz * cp - dy * sp) / m + dx * cosine;
                uy = sine * (dy * dz * cp + dx * sp) / m + dy * cosine;
                uz = -sine * cp * m + dz * cosine;
            }
            dx = ux; dy = uy; dz = uz;
        }
    }
    for (int i = 0; i < n_z; i++)
        for (int k = 0; k < n_r; k++) {
            double inner = fmax(0, rings[k] - half), outer = rings[k] + half;
            double area = box ? 8 * half * half_height : M_PI * (outer * outer - inner * inner);
            printf("%g,%g", planes[i], rings[k]);
            for (int j = 0; j < n_a; j++) {
                double mean = 0, square = 0;
                for (int m = 0; m < BATCHES; m++) {
                    double e = tally[m][j][i][k] * BATCHES / photons * power / area;
                    mean += e / BATCHES; square += e * e / BATCHES;
                }
                printf(",%.7g,%.2g", mean, sqrt((square - mean * mean) / (BATCHES - 1)));
            }
            printf("\n");
        }
    return 0;
}
