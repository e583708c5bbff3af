/* Photons walked one by one through a scene, from the definitions of the physics alone.

   Every photon flies straight until it collides (Beer-Lambert, coefficient b), is turned by a phase function
   (Henyey-Greenstein, or Fournier-Forand by the cumulated form of Fournier and Jonasz 1999), and in a tank
   meets walls, which reflect after Lambert, panes, whose two faces mirror after Fresnel and which leave the
   rest to a wall behind them, and a water surface, which mirrors after Fresnel. All choices are those of
   nature; only absorption is a weight, exp(-integral of a along the path). Photons of little weight, and such
   as fly away beyond the last plane, play roulette, which changes no mean.

   Counted is the power that crosses square cells of planes z = const forward, per area, for unit radiant
   intensity on the lamp's axis. Eight classes of light are told apart:
       0 direct, 2 walls, 4 surface and at most one wall, 6 surface and walls twice or more,
   and one more of each, the same scattered as well. In a tank with panes 2 is light that met walls, whatever
   else it met, and 4 such as met surface or panes alone; there is no 6.

   walk FILE: lines "name value..." (see `struct scene`), x across, y up, z along the tank, lamp window at 0.
   Prints numbers by batch, class, plane, row (y) and column (x), the last running fastest. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CLASSES = 8, MOST_BATCHES = 64, MOST_PLANES = 8, MOST_CELLS = 32 };
enum { PHASE_NODES = 40000, SIMPSON = 20000 };

/* What FILE may say; all else is 0. Lengths in m, angles in degrees, coefficients in 1/m. */
static struct scene {
    double photons, seed, batches;
    double hwhm_deg, offset_x, offset_y, tilt_x_deg, tilt_y_deg; /* a Gaussian beam and its pose */
    double behind;                                          /* apparent source, so far behind the window */
    double radius;                                          /* of a uniformly bright window */
    double a, b, g;                                         /* water; Henyey-Greenstein's g */
    double gradient, gradient_centre;                       /* a grows by so much per m of z, from there */
    double ff_n, ff_mu;                                     /* Fournier-Forand where ff_n > 0 */
    double tank, width, depth, length, back, lamp_depth;    /* tank = 1: there are walls */
    double wall, floor;                                     /* albedos */
    double surface, slope_deg, index;                       /* surface = 1: water under air; waves */
    double glass_sides, glass_others, glass; /* factors on what panes mirror (others: floor, ends); index */
    double half, cells, planes, z[MOST_PLANES];             /* planes: half their side, cells along it, z */
    double acceptance_deg;                                  /* half width of a Gaussian acceptance */
} s;
#define FIELD(name) {#name, &s.name}
static const struct { const char *name; double *at; } fields[] = {
    FIELD(photons), FIELD(seed), FIELD(batches), FIELD(hwhm_deg), FIELD(offset_x), FIELD(offset_y),
    FIELD(tilt_x_deg), FIELD(tilt_y_deg), FIELD(behind), FIELD(radius), FIELD(a), FIELD(b), FIELD(g),
    FIELD(gradient), FIELD(gradient_centre), FIELD(ff_n), FIELD(ff_mu), FIELD(tank), FIELD(width),
    FIELD(depth), FIELD(length), FIELD(back), FIELD(lamp_depth), FIELD(wall), FIELD(floor), FIELD(surface),
    FIELD(slope_deg), FIELD(index), FIELD(glass_sides), FIELD(glass_others), FIELD(glass), FIELD(half),
    FIELD(cells), FIELD(acceptance_deg),
};

/* Roulette: a photon left with less than this part of its light goes on with this chance, and weighs more. */
static const double LITTLE = 0.02, GOES_ON = 0.2;
/* The same for one that flies away beyond the last plane. */
static const double STAYS = 0.5;
/* Open water is left behind at this distance. */
static const double FAR_AWAY = 400;
/* Slopes of waves beyond so many standard deviations do not occur. */
static const double STEEPEST = 8;

static double tally[MOST_BATCHES][CLASSES][MOST_PLANES][MOST_CELLS][MOST_CELLS];
static double phase_cdf[PHASE_NODES], phase_square[PHASE_NODES];
static uint64_t state[4];

/* xoshiro256++ of Blackman and Vigna (2018), seeded by splitmix64. */
static inline uint64_t turned(uint64_t x, int by) { return (x << by) | (x >> (64 - by)); }

static inline double uniform(void) { /* inside (0, 1) */
    uint64_t sum = turned(state[0] + state[3], 23) + state[0], shifted = state[1] << 17;
    state[2] ^= state[0], state[3] ^= state[1], state[1] ^= state[2], state[0] ^= state[3];
    state[2] ^= shifted, state[3] = turned(state[3], 45);
    return ((double)(sum >> 11) + 0.5) * 0x1p-53;
}

static void start_random(uint64_t seed) {
    for (int i = 0; i < 4; i++) {
        uint64_t v = (seed += 0x9E3779B97F4A7C15ULL);
        v = (v ^ (v >> 30)) * 0xBF58476D1CE4E5B9ULL;
        v = (v ^ (v >> 27)) * 0x94D049BB133111EBULL;
        state[i] = v ^ (v >> 31);
    }
}

static double normal(void) { return sqrt(-2 * log(uniform())) * cos(2 * M_PI * uniform()); }

static void read_scene(const char *path) {
    FILE *file = fopen(path, "r");
    char name[64];
    if (!file) exit(2);
    while (fscanf(file, "%63s", name) == 1) {
        int known = 0;
        if (!strcmp(name, "z")) { /* as many as planes says, which comes before */
            for (int i = 0; i < s.planes; i++) known = fscanf(file, "%lf", &s.z[i]) == 1;
        } else if (!strcmp(name, "planes")) {
            known = fscanf(file, "%lf", &s.planes) == 1;
        } else {
            for (size_t i = 0; i < sizeof fields / sizeof *fields; i++)
                if (!strcmp(name, fields[i].name)) known = fscanf(file, "%lf", fields[i].at) == 1;
        }
        if (!known) { fprintf(stderr, "%s?\n", name); exit(2); }
    }
    fclose(file);
    if (s.batches > MOST_BATCHES || s.planes > MOST_PLANES || s.cells > MOST_CELLS) exit(2);
}

/* A direction at an angle of this cosine to u, at any turn about it. */
static void deflect(double *u, double cosine) {
    double sine = sqrt(fmax(0, 1 - cosine * cosine)), turn = 2 * M_PI * uniform();
    /* Two unit vectors across u; begun with the axis that u is least along. */
    int least = fabs(u[0]) < fabs(u[1]) ? 0 : 1;
    if (fabs(u[2]) < fabs(u[least])) least = 2;
    double e[3] = {0, 0, 0}, p[3], q[3], along = u[least];
    e[least] = 1;
    double length = sqrt(1 - along * along);
    for (int i = 0; i < 3; i++) p[i] = (e[i] - along * u[i]) / length;
    q[0] = u[1] * p[2] - u[2] * p[1], q[1] = u[2] * p[0] - u[0] * p[2], q[2] = u[0] * p[1] - u[1] * p[0];
    double c = sine * cos(turn), d = sine * sin(turn), square = 0;
    for (int i = 0; i < 3; i++) u[i] = cosine * u[i] + c * p[i] + d * q[i], square += u[i] * u[i];
    for (int i = 0; i < 3; i++) u[i] /= sqrt(square);
}

/* Part of the light that Fournier and Forand's particles scatter by less than theta; x = sin^2(theta / 2). */
static double fournier_forand(double x) {
    double nu = 0.5 * (3 - s.ff_mu), unit = 4 / (3 * (s.ff_n - 1) * (s.ff_n - 1));
    double d = unit * x, d_nu = pow(d, nu), back_nu = pow(unit, nu), cosine = 1 - 2 * x;
    double first = 1 + nu * (1 - x); /* where d = 1 */
    if (fabs(d - 1) > 1e-9) first = ((1 - d * d_nu) - (1 - d_nu) * x) / ((1 - d) * d_nu);
    return first + (1 - back_nu) / (8 * (unit - 1) * back_nu) * cosine * (1 - cosine * cosine);
}

static void tabulate_phase(void) { /* angles from 2e-7 rad to pi */
    for (int i = 0; i < PHASE_NODES; i++) {
        phase_square[i] = pow(10, -14.0 * (PHASE_NODES - 1 - i) / (PHASE_NODES - 1));
        phase_cdf[i] = fournier_forand(phase_square[i]);
    }
}

static double scattering_cosine(void) {
    double u = uniform();
    if (s.ff_n > 0) {
        int low = 0, high = PHASE_NODES - 1;
        if (u < phase_cdf[0]) return 1;
        while (high - low > 1) {
            int middle = (low + high) / 2;
            if (phase_cdf[middle] <= u) low = middle; else high = middle;
        }
        double part = (u - phase_cdf[low]) / (phase_cdf[high] - phase_cdf[low]);
        return 1 - 2 * (phase_square[low] + part * (phase_square[high] - phase_square[low]));
    }
    if (fabs(s.g) < 1e-6) return 2 * u - 1;
    double root = (1 - s.g * s.g) / (1 - s.g + 2 * s.g * u);
    return fmin(1, fmax(-1, (1 + s.g * s.g - root * root) / (2 * s.g)));
}

/* Absorption along so much of a flight. */
static inline double depth_along(const double *at, const double *u, double way) {
    return (s.a + s.gradient * (at[2] + 0.5 * u[2] * way - s.gradient_centre)) * way;
}

/* Angle from the beam's axis: theta exp(-ln 2 theta^2 / h^2) is drawn, the part sin(theta) / theta kept. */
static double beam_angle(double hwhm) {
    for (;;) {
        double theta = hwhm * sqrt(-log(uniform()) / M_LN2);
        if (theta < 0.5 * M_PI && uniform() * theta < sin(theta)) return theta;
    }
}

static double beam_power(double hwhm) { /* for unit intensity on the axis, sr; Simpson's rule */
    double sum = 0, step = 0.5 * M_PI / SIMPSON;
    for (int i = 0; i <= SIMPSON; i++) {
        double theta = i * step, weight = i == 0 || i == SIMPSON ? 1 : i % 2 ? 4 : 2;
        sum += weight * exp(-M_LN2 * theta * theta / (hwhm * hwhm)) * sin(theta);
    }
    return 2 * M_PI * sum * step / 3;
}

/* Unpolarised reflectance of the surface for light from the water. */
static double fresnel(double cosine) {
    double sine_square = s.index * s.index * (1 - cosine * cosine);
    if (sine_square >= 1) return 1;
    double out = sqrt(1 - sine_square);
    double across = (s.index * cosine - out) / (s.index * cosine + out);
    double within = (cosine - s.index * out) / (cosine + s.index * out);
    return 0.5 * (across * across + within * within);
}

/* Part that two faces reflect, between which light goes to and fro, from the amplitude that each reflects. */
static double both_faces(double one, double other) {
    one *= one, other *= other;
    return (one + other - 2 * one * other) / (1 - one * other);
}

/* Unpolarised reflectance of a pane with air behind for light from the water; no phases, no absorption. */
static double pane(double cosine) {
    double n = s.index, m = s.glass, sine_square = n * n * (1 - cosine * cosine);
    if (sine_square >= 1) return 1;
    double out = sqrt(1 - sine_square), inside = sqrt(1 - sine_square / (m * m));
    double across = both_faces((n * cosine - m * inside) / (n * cosine + m * inside),
                               (m * inside - out) / (m * inside + out));
    double within = both_faces((m * cosine - n * inside) / (m * cosine + n * inside),
                               (inside - m * out) / (inside + m * out));
    return 0.5 * (across + within);
}

/* Mirror u at the surface above; returns the part that is reflected. Waves are facets whose slopes are normal
   across and along alike; each is met as often as its area seen by the light says. */
static double mirror(double *u) {
    double m[3] = {0, -1, 0}, level = hypot(u[0], u[2]);
    if (s.slope_deg > 0 && level > 0) {
        double sigma = tan(s.slope_deg * M_PI / 180), slope, most = u[1] + level * STEEPEST * sigma;
        /* A facet that rises against the light (slope < 0 along its way) shows more of itself. */
        do slope = sigma * normal();
        while (fabs(slope) > STEEPEST * sigma || uniform() * most > u[1] - level * slope);
        double other = sigma * normal(), along_x = u[0] / level, along_z = u[2] / level;
        double sx = slope * along_x - other * along_z, sz = slope * along_z + other * along_x;
        double scale = 1 / sqrt(1 + sx * sx + sz * sz);
        m[0] = sx * scale, m[1] = -scale, m[2] = sz * scale; /* down into the water */
    }
    double cosine = -(u[0] * m[0] + u[1] * m[1] + u[2] * m[2]);
    for (int i = 0; i < 3; i++) u[i] += 2 * cosine * m[i];
    return fresnel(fmin(1, cosine));
}

/* Into the half space that axis and sign point to, after Lambert. */
static void lambert(double *u, int axis, double sign) {
    double square = uniform(), turn = 2 * M_PI * uniform();
    u[axis] = sign * sqrt(1 - square);
    u[(axis + 1) % 3] = sqrt(square) * cos(turn), u[(axis + 2) % 3] = sqrt(square) * sin(turn);
}

int main(int count, char **words) {
    if (count != 2) return 2;
    read_scene(words[1]);
    start_random((uint64_t)s.seed);
    if (s.ff_n > 0) tabulate_phase();
    double first[3] = {-0.5 * s.width, s.lamp_depth - s.depth, -s.back};
    double last[3] = {0.5 * s.width, s.lamp_depth, s.length - s.back};
    double hwhm = s.hwhm_deg * M_PI / 180, acceptance = s.acceptance_deg * M_PI / 180;
    double axis[3] = {tan(s.tilt_x_deg * M_PI / 180), tan(s.tilt_y_deg * M_PI / 180), 1};
    double axis_length = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + 1), per_m = s.cells / (2 * s.half);
    for (int i = 0; i < 3; i++) axis[i] /= axis_length;
    int batches = (int)s.batches, planes = (int)s.planes, cells = (int)s.cells;
    long each = (long)(s.photons / batches);
    double end = s.z[planes - 1];
    int panes = s.glass_sides > 0 || s.glass_others > 0;
    for (int batch = 0; batch < batches; batch++)
        for (long n = 0; n < each; n++) {
            double u[3] = {axis[0], axis[1], axis[2]}, ring = s.radius * sqrt(uniform());
            double turn = 2 * M_PI * uniform();
            deflect(u, cos(beam_angle(hwhm)));
            /* Light seems to come from behind the window; water, and the walk, begin at the window. */
            double at[3] = {s.offset_x + ring * cos(turn), s.offset_y + ring * sin(turn), 0};
            if (s.behind > 0 && u[2] > 0)
                at[0] += u[0] / u[2] * s.behind, at[1] += u[1] / u[2] * s.behind;
            double depth = 0, weight = 1; /* exp(-depth) counts too */
            int scattered = 0, walls = 0, mirrored = 0;
            for (;;) {
                double way = s.b > 0 ? -log(uniform()) / s.b : INFINITY;
                int wall = -1;
                for (int k = 0; s.tank && k < 3; k++) {
                    if (u[k] == 0) continue;
                    double to = fmax(0, ((u[k] > 0 ? last[k] : first[k]) - at[k]) / u[k]);
                    if (to < way) way = to, wall = k;
                }
                int kind = (mirrored ? (walls > 1 ? 6 : 4) : walls ? 2 : 0) + scattered;
                if (panes && walls) kind = 2 + scattered;
                for (int i = 0; u[2] > 0 && i < planes; i++) {
                    double to = (s.z[i] - at[2]) / u[2];
                    if (to <= 0 || to > way) continue;
                    double column = (at[0] + to * u[0] + s.half) * per_m;
                    double row = (at[1] + to * u[1] + s.half) * per_m;
                    if (column < 0 || row < 0 || column >= cells || row >= cells) continue;
                    double light = weight * exp(-depth - depth_along(at, u, to));
                    if (acceptance > 0) light *= exp(-M_LN2 * pow(acos(fmin(1, u[2])) / acceptance, 2));
                    tally[batch][kind][i][(int)row][(int)column] += light;
                }
                if (!isfinite(way)) break;
                depth += depth_along(at, u, way);
                for (int i = 0; i < 3; i++) at[i] += way * u[i];
                if (wall < 0) {
                    if (!s.tank && hypot(hypot(at[0], at[1]), at[2]) > FAR_AWAY) break;
                    deflect(u, scattering_cosine());
                    scattered = 1;
                } else {
                    double sign = u[wall] > 0 ? -1 : 1;
                    at[wall] = u[wall] > 0 ? last[wall] : first[wall];
                    int top = wall == 1 && sign < 0;
                    double bare = wall == 0 ? s.glass_sides : top ? 0 : s.glass_others;
                    if (s.surface && top) {
                        if (uniform() >= mirror(u)) break;
                        mirrored = 1;
                    } else if (bare > 0 && uniform() < bare * pane(fabs(u[wall]))) {
                        u[wall] = -u[wall];
                        mirrored = 1;
                    } else {
                        if (uniform() >= (wall == 1 && sign > 0 ? s.floor : s.wall)) break;
                        lambert(u, wall, sign);
                        walls++;
                    }
                }
                double left = weight * exp(-depth);
                double chance = (left < LITTLE ? GOES_ON : 1) * (at[2] > end && u[2] > 0 ? STAYS : 1);
                if (chance < 1 && uniform() >= chance) break;
                weight /= chance;
            }
        }
    double scale = beam_power(hwhm) / each * per_m * per_m;
    for (int m = 0; m < batches; m++)
        for (int c = 0; c < CLASSES; c++)
            for (int i = 0; i < planes; i++)
                for (int y = 0; y < cells; y++)
                    for (int x = 0; x < cells; x++) printf("%.9g\n", tally[m][c][i][y][x] * scale);
    return 0;
}
