/* A typical hand-written FMU: forward Euler with inner steps of 1e-4 s, inputs held over the step. */
#include "model.h"

typedef struct {
    double v[33], x[6];
    System s;
} Instance;

static const double INNER = 1e-4;

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
    return (void)c, (void)vr, (void)n, (void)value, 0; /* Euler always uses the rates */
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
int fmi2DoStep(void *c, double t, double h, int no_state) {
    Instance *i = c;
    (void)t, (void)no_state;
    int steps = (int)(h / INNER + 0.5);
    for (int step = 0; step < steps; step++) {
        double rate[6];
        for (int r = 0; r < 6; r++) {
            double sum = 0;
            for (int k = 0; k < 6; k++) sum += i->s.A[r][k] * i->x[k];
            for (int k = 0; k < 4; k++) sum += i->s.B[r][k] * i->v[k];
            rate[r] = sum;
        }
        for (int r = 0; r < 6; r++) i->x[r] += h / steps * rate[r];
    }
    for (int r = 0; r < 6; r++) {
        double sum = 0;
        for (int k = 0; k < 6; k++) sum += i->s.C[r][k] * i->x[k];
        for (int k = 0; k < 4; k++) sum += i->s.D[r][k] * i->v[k];
        i->v[TAU1 + r] = sum;
    }
    return 0;
}
