/* The FMU's exact update, specialized for this testbed: no checks, no state machine, no logging, one set of parameters.
 * The reference for the cost of the FMU's checks and generality. Derived from the paper.
 *
 * Pitch and roll, the mean of the two sides and half their difference, are the two lanes of a vector; each has the
 * state z = [q_I - u, q_II - u, v] relative to its motor angle u. While the motor turns at rate w,
 *   z' = A z + b w,
 * and a jump d of its angle makes z jump by b d. */
#include "model.h"

typedef double Lanes __attribute__((vector_size(16)));

typedef struct {
    double input[4], set_rate[2];
    Lanes z[3], u, w;    /* at the end of the last step; w from the parabola through the last samples */
    Lanes sample[2];     /* the last motor angles and the ones before them */
    Lanes rate[3], bend[3]; /* weights of three samples (current, last, before) in the parabola's slope and quadratic term */
    double h1, h2;       /* the last steps */
    int samples, uneven, special, has_rate[2], use_omega;
} State;

typedef struct {
    State now;
    double h;                 /* step size for growth and ramp: factors of z and w in a step */
    Lanes growth[3][3], ramp[3];
    Lanes A[3][3], b[3], torque[3];
    System sides;
} Instance;

static Lanes lanes(double side1, double side2) { return 0.5 * (Lanes){side1 + side2, side1 - side2}; }
static double side(Lanes x, int i) { return i ? x[0] - x[1] : x[0] + x[1]; }

/* Coefficients of pitch and roll from a row of eq. (11), whose columns come in pairs of sides. */
static Lanes pair(const double *row) { return (Lanes){row[0] + row[1], row[0] - row[1]}; }

void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l) {
    (void)n, (void)t, (void)g, (void)r, (void)f, (void)v, (void)l;
    Instance *i = calloc(1, sizeof *i);
    make_system(&i->sides);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) i->A[r][c] = pair(&i->sides.A[2 * r][2 * c]);
        i->b[r] = pair(&i->sides.B[2 * r][2]) - (r < 2 ? 1.0 : 0.0);
        i->torque[r] = pair(&i->sides.C[0][2 * r]);
    }
    return i;
}

/* growth = exp(A h) and ramp = (integral of exp(A s) over 0..h) b: a Taylor series for a short step, which is then doubled. */
static __attribute__((noinline)) void make_matrices(Instance *i, double h) {
    Lanes Ah[3][3], term[3][4], sum[3][4];
    double norm = 0;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 2; k++)
            norm = fmax(norm, h * (fabs(i->A[r][0][k]) + fabs(i->A[r][1][k]) + fabs(i->A[r][2][k])));
    int doublings = norm > 0.25 ? (int)ceil(log2(norm / 0.25)) : 0;
    double part = ldexp(h, -doublings);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) sum[r][c] = term[r][c] = Ah[r][c] = i->A[r][c] * part, sum[r][c] += r == c;
        sum[r][3] = term[r][3] = i->b[r] * part;
    }
    for (int n = 2; n <= 13; n++)
        for (int c = 0; c < 4; c++) {
            Lanes t[3] = {term[0][c] / n, term[1][c] / n, term[2][c] / n};
            for (int r = 0; r < 3; r++) {
                term[r][c] = Ah[r][0] * t[0] + Ah[r][1] * t[1] + Ah[r][2] * t[2];
                sum[r][c] += term[r][c];
            }
        }
    for (; doublings > 0; doublings--) {
        memcpy(term, sum, sizeof sum);
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 4; c++) {
                sum[r][c] = term[r][0] * term[0][c] + term[r][1] * term[1][c] + term[r][2] * term[2][c];
                if (c == 3) sum[r][c] += term[r][c];
            }
    }
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) i->growth[r][c] = sum[r][c];
        i->ramp[r] = sum[r][3];
    }
    i->h = h;
}

/* The parabola through the last samples; a line if there are two, constant if there is one. */
static __attribute__((noinline)) void make_parabola(State *s, double h) {
    const Lanes one = {1, 1};
    s->h2 = s->h1, s->h1 = h, s->samples++, s->uneven--;
    double p = 1 / s->h1, q = s->samples > 1 ? 1 / s->h2 : 0, pq = s->samples > 1 ? 1 / (s->h1 + s->h2) : 0;
    s->bend[0] = one * pq * p, s->bend[1] = -one * pq * (p + q), s->bend[2] = one * pq * q;
    s->rate[0] = one * p + s->bend[0] * h, s->rate[1] = s->bend[1] * h - p * one, s->rate[2] = s->bend[2] * h;
}

/* Replaces rates by input derivatives or omega, if they are set. */
static __attribute__((noinline)) void take_rates(State *s, Lanes *w, Lanes *bend) {
    double rate[2], curve[2];
    for (int m = 0; m < 2; m++) {
        int set = s->has_rate[m] || s->use_omega;
        rate[m] = s->has_rate[m] ? s->set_rate[m] : s->use_omega ? s->input[OMEGA1 + m] : side(*w, m);
        curve[m] = set ? 0 : side(*bend, m);
        s->has_rate[m] = 0;
    }
    *w = lanes(rate[0], rate[1]), *bend = lanes(curve[0], curve[1]), s->special = s->use_omega;
}

int fmi2DoStep(void *c, double t, double h, int no_state) {
    Instance *i = c;
    State *s = &i->now;
    (void)t, (void)no_state;
    if (i->h != h) make_matrices(i, h);
    if (s->h1 != h) s->uneven = 2;
    Lanes u = lanes(s->input[THETA1], s->input[THETA1 + 1]);
    Lanes w = s->rate[0] * u + s->rate[1] * s->sample[0] + s->rate[2] * s->sample[1];
    Lanes bend = s->bend[0] * u + s->bend[1] * s->sample[0] + s->bend[2] * s->sample[1];
    if (s->special) take_rates(s, &w, &bend);
    Lanes jump = s->samples ? u - s->u : (Lanes){0, 0};
    if (!s->samples) s->z[0] -= u, s->z[1] -= u;
    Lanes z0 = s->z[0] + i->b[0] * jump, z1 = s->z[1] + i->b[1] * jump, z2 = s->z[2] + i->b[2] * jump;
    for (int r = 0; r < 3; r++)
        s->z[r] = i->growth[r][0] * z0 + i->growth[r][1] * z1 + i->growth[r][2] * z2 + i->ramp[r] * w;
    s->sample[1] = s->sample[0], s->sample[0] = u;
    s->u = u + w * h;
    s->w = w + bend * (2 * h);
    if (s->uneven) make_parabola(s, h);
    return 0;
}

int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *value) {
    double *input = ((Instance *)c)->now.input;
    for (size_t k = 0; k < n; k++) input[vr[k]] = value[k];
    return 0;
}
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *value) {
    const Instance *i = c;
    const State *s = &i->now;
    const double ratio = 2 * i->sides.C[3][2];
    Lanes torque = i->torque[0] * s->z[0] + i->torque[1] * s->z[1] + i->torque[2] * (s->z[2] - s->w);
    for (size_t k = 0; k < n; k++) switch (vr[k]) {
        case TAU1: value[k] = side(torque, 0); break;
        case TAU2: value[k] = side(torque, 1); break;
        case PITCH: value[k] = s->z[1][0] + s->u[0]; break;
        case ROLL: value[k] = ratio * (s->z[1][1] + s->u[1]); break;
        case PITCH_RATE: value[k] = s->z[2][0]; break;
        case ROLL_RATE: value[k] = ratio * s->z[2][1]; break;
        case THETA3: case THETA3 + 1: value[k] = side(s->z[0] + s->u, vr[k] - THETA3); break;
        case THETA3 + 2: case THETA3 + 3: value[k] = side(s->z[1] + s->u, vr[k] - THETA3 - 2); break;
        case THETA3 + 4: case THETA3 + 5: value[k] = side(s->z[2], vr[k] - THETA3 - 4); break;
        default: value[k] = s->input[vr[k]];
    }
    return 0;
}
int fmi2SetBoolean(void *c, const unsigned *vr, size_t n, const int *value) {
    State *s = &((Instance *)c)->now;
    (void)vr, (void)n;
    s->use_omega = value[0], s->special |= value[0];
    return 0;
}
int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *order, const double *value) {
    State *s = &((Instance *)c)->now;
    (void)order;
    for (size_t k = 0; k < n; k++) s->set_rate[vr[k]] = value[k], s->has_rate[vr[k]] = s->special = 1;
    return 0;
}
int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *dk,
                                 double *du) {
    const System *s = &((Instance *)c)->sides;
    for (size_t a = 0; a < nu; a++) {
        du[a] = 0;
        for (size_t b = 0; b < nk; b++) {
            int row = (int)u[a], known = (int)k[b];
            double p = row >= THETA3 ? known == row
                     : known < 4     ? s->D[row - TAU1][known]
                                     : s->C[row - TAU1][known - THETA3];
            du[a] += p * dk[b];
        }
    }
    return 0;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(State));
    memcpy(*state, c, sizeof(State));
    return 0;
}
int fmi2SetFMUstate(void *c, void *state) { return memcpy(c, state, sizeof(State)), 0; }
int fmi2FreeFMUstate(void *c, void **state) { return (void)c, free(*state), *state = NULL, 0; }
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double tol, double start, int sd, double stop) {
    return (void)c, (void)d, (void)tol, (void)start, (void)sd, (void)stop, 0;
}
int fmi2EnterInitializationMode(void *c) { return (void)c, 0; }
int fmi2ExitInitializationMode(void *c) { return (void)c, 0; }
