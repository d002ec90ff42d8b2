/* The FMU's exact update as bare C: no checks, no state machine, no logging, full 6 x 6 matrices.
 * The yardstick for what the FMU's checks and its panic-safe boundary cost. */
#include "model.h"

typedef struct {
    double v[33]; /* values by value reference */
    double x[6], path_end[2], end_rate[2], earlier[2][2], set_rate[2];
    double h1, h2, h; /* last steps; step size of the matrices */
    int samples, has_rate[2], use_omega;
    double phi[6][6], gamma_angle[6][2], gamma_rate[6][2];
    System s;
} Instance;

/* exp of [A B; 0 shift] h by scaling, Taylor and squaring; u = [theta, omega], theta' = omega. */
static void make_matrices(Instance *i, double h) {
    double a[10][10] = {{0}}, term[10][10], sum[10][10], next[10][10], norm = 0;
    for (int r = 0; r < 6; r++) {
        for (int c = 0; c < 6; c++) a[r][c] = i->s.A[r][c];
        for (int c = 0; c < 4; c++) a[r][6 + c] = i->s.B[r][c];
    }
    a[6][8] = a[7][9] = 1;
    for (int r = 0; r < 10; r++) {
        double row = 0;
        for (int c = 0; c < 10; c++) row += fabs(a[r][c]);
        norm = fmax(norm, row * h);
    }
    int doublings = norm > 0.25 ? (int)ceil(log2(norm / 0.25)) : 0;
    memset(sum, 0, sizeof sum);
    for (int r = 0; r < 10; r++) sum[r][r] = 1;
    memcpy(term, sum, sizeof sum);
    for (int n = 1; n <= 13; n++) {
        for (int r = 0; r < 10; r++)
            for (int c = 0; c < 10; c++) {
                double t = 0;
                for (int k = 0; k < 10; k++) t += term[r][k] * a[k][c];
                next[r][c] = t * ldexp(h, -doublings) / n;
            }
        memcpy(term, next, sizeof next);
        for (int r = 0; r < 10; r++)
            for (int c = 0; c < 10; c++) sum[r][c] += term[r][c];
    }
    for (; doublings > 0; doublings--) {
        for (int r = 0; r < 10; r++)
            for (int c = 0; c < 10; c++) {
                double t = 0;
                for (int k = 0; k < 10; k++) t += sum[r][k] * sum[k][c];
                next[r][c] = t;
            }
        memcpy(sum, next, sizeof next);
    }
    for (int r = 0; r < 6; r++) {
        for (int c = 0; c < 6; c++) i->phi[r][c] = sum[r][c];
        for (int c = 0; c < 2; c++) i->gamma_angle[r][c] = sum[r][6 + c], i->gamma_rate[r][c] = sum[r][8 + c];
    }
    i->h = h;
}

void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l) {
    (void)n, (void)t, (void)g, (void)r, (void)f, (void)v, (void)l;
    Instance *i = calloc(1, sizeof *i);
    make_system(&i->s);
    return i;
}
void fmi2FreeInstance(void *c) { free(c); }
int fmi2SetupExperiment(void *c, int d, double tol, double start, int sd, double stop) {
    (void)c, (void)d, (void)tol, (void)start, (void)sd, (void)stop;
    return 0;
}
int fmi2EnterInitializationMode(void *c) { return (void)c, 0; }
int fmi2ExitInitializationMode(void *c) { return (void)c, 0; }
int fmi2SetBoolean(void *c, const unsigned *vr, size_t n, const int *value) {
    (void)vr, (void)n;
    ((Instance *)c)->use_omega = value[0];
    return 0;
}
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *value) {
    double *v = ((Instance *)c)->v;
    for (size_t k = 0; k < n; k++) v[vr[k]] = value[k];
    return 0;
}
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *value) {
    const double *v = ((Instance *)c)->v;
    for (size_t k = 0; k < n; k++) value[k] = v[vr[k]];
    return 0;
}
int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *order, const double *value) {
    Instance *i = c;
    (void)order;
    for (size_t k = 0; k < n; k++) i->set_rate[vr[k]] = value[k], i->has_rate[vr[k]] = 1;
    return 0;
}
int fmi2DoStep(void *c, double t, double h, int no_state) {
    Instance *i = c;
    (void)t, (void)no_state;
    if (i->h != h) make_matrices(i, h);
    double w[2], bend[2] = {0, 0}, d[2], x[6], u[4];
    for (int m = 0; m < 2; m++) {
        double theta = i->v[THETA1 + m];
        if (i->has_rate[m]) w[m] = i->set_rate[m];
        else if (i->use_omega) w[m] = i->v[OMEGA1 + m];
        else if (i->samples == 0) w[m] = 0;
        else if (i->samples == 1) w[m] = (theta - i->earlier[m][0]) / i->h1;
        else {
            double last = (theta - i->earlier[m][0]) / i->h1;
            bend[m] = (last - (i->earlier[m][0] - i->earlier[m][1]) / i->h2) / (i->h1 + i->h2);
            w[m] = last + bend[m] * i->h1;
        }
        d[m] = i->samples ? theta - i->path_end[m] : 0;
    }
    for (int r = 0; r < 6; r++) x[r] = i->x[r] + i->s.B[r][2] * d[0] + i->s.B[r][3] * d[1];
    for (int r = 0; r < 6; r++) {
        double sum = i->gamma_angle[r][0] * i->v[THETA1] + i->gamma_angle[r][1] * i->v[THETA2]
                   + i->gamma_rate[r][0] * w[0] + i->gamma_rate[r][1] * w[1];
        for (int k = 0; k < 6; k++) sum += i->phi[r][k] * x[k];
        i->x[r] = sum;
    }
    for (int m = 0; m < 2; m++) {
        i->earlier[m][1] = i->earlier[m][0], i->earlier[m][0] = i->v[THETA1 + m];
        u[m] = i->path_end[m] = i->v[THETA1 + m] + w[m] * h;
        u[2 + m] = i->end_rate[m] = w[m] + 2 * bend[m] * h;
        i->has_rate[m] = 0;
    }
    i->h2 = i->h1, i->h1 = h;
    if (i->samples < 2) i->samples++;
    for (int r = 0; r < 6; r++) {
        double sum = 0;
        for (int k = 0; k < 6; k++) sum += i->s.C[r][k] * i->x[k];
        for (int k = 0; k < 4; k++) sum += i->s.D[r][k] * u[k];
        i->v[TAU1 + r] = sum;
    }
    for (int r = 0; r < 6; r++) i->v[THETA3 + r] = i->x[r];
    return 0;
}
int fmi2GetFMUstate(void *c, void **state) {
    if (!*state) *state = malloc(sizeof(Instance));
    memcpy(*state, c, sizeof(Instance));
    return 0;
}
int fmi2SetFMUstate(void *c, void *state) { return memcpy(c, state, sizeof(Instance)), 0; }
int fmi2FreeFMUstate(void *c, void **state) { return (void)c, free(*state), *state = NULL, 0; }
int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *dk,
                                 double *du) {
    const Instance *i = c;
    for (size_t a = 0; a < nu; a++) {
        du[a] = 0;
        for (size_t b = 0; b < nk; b++) {
            int row = (int)u[a], known = (int)k[b];
            double p = row >= THETA3 ? known == row
                     : known < 4     ? i->s.D[row - TAU1][known]
                                     : i->s.C[row - TAU1][known - THETA3];
            du[a] += p * dk[b];
        }
    }
    return 0;
}
