/* Empty functions, to measure the cost of the loop and the calls. */
#include <stddef.h>

static int something;

void *fmi2Instantiate(const char *n, int t, const char *g, const char *r, const void *f, int v, int l) {
    (void)n, (void)t, (void)g, (void)r, (void)f, (void)v, (void)l;
    return &something;
}
void fmi2FreeInstance(void *c) { (void)c; }
int fmi2SetupExperiment(void *c, int d, double tol, double start, int sd, double stop) {
    return (void)c, (void)d, (void)tol, (void)start, (void)sd, (void)stop, 0;
}
int fmi2EnterInitializationMode(void *c) { return (void)c, 0; }
int fmi2ExitInitializationMode(void *c) { return (void)c, 0; }
int fmi2SetBoolean(void *c, const unsigned *vr, size_t n, const int *value) {
    return (void)c, (void)vr, (void)n, (void)value, 0;
}
int fmi2SetReal(void *c, const unsigned *vr, size_t n, const double *value) {
    return (void)c, (void)vr, (void)n, (void)value, 0;
}
int fmi2GetReal(void *c, const unsigned *vr, size_t n, double *value) {
    return (void)c, (void)vr, (void)n, (void)value, 0;
}
int fmi2SetRealInputDerivatives(void *c, const unsigned *vr, size_t n, const int *order, const double *value) {
    return (void)c, (void)vr, (void)n, (void)order, (void)value, 0;
}
int fmi2DoStep(void *c, double t, double h, int no_state) { return (void)c, (void)t, (void)h, (void)no_state, 0; }
int fmi2GetFMUstate(void *c, void **state) { return (void)c, (void)state, 0; }
int fmi2SetFMUstate(void *c, void *state) { return (void)c, (void)state, 0; }
int fmi2FreeFMUstate(void *c, void **state) { return (void)c, (void)state, 0; }
int fmi2GetDirectionalDerivative(void *c, const unsigned *u, size_t nu, const unsigned *k, size_t nk, const double *dk,
                                 double *du) {
    return (void)c, (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du, 0;
}
