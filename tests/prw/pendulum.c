/* A damped pendulum as an FMU: angle'' = torque - k sin(angle) - angle'. It is nonlinear, so its linear model depends on the angle.
 * The FMU supports only Model Exchange of FMI 2.0 or, if FMI3 is defined, only Co-Simulation of FMI 3.0. It only has the functions
 * that linearization needs. */
#include <math.h>
#include <stdlib.h>

#ifdef FMI3
#include "fmi3Functions.h"
typedef fmi3Status Status;
typedef fmi3Instance Instance;
typedef fmi3ValueReference Reference;
#define F(name) fmi3##name
#define OK fmi3OK
#define ERROR fmi3Error
#else
#include "fmi2Functions.h"
typedef fmi2Status Status;
typedef fmi2Component Instance;
typedef fmi2ValueReference Reference;
#define F(name) fmi2##name
#define OK fmi2OK
#define ERROR fmi2Error
#endif

enum { TORQUE, ANGLE, RATE, DER_RATE, HEIGHT, STIFFNESS, COUNT };

typedef struct {
    double values[COUNT];
    int ready;
} Pendulum;

static Instance as_new(Pendulum *p) {
    *p = (Pendulum){.values = {[ANGLE] = 0.5, [STIFFNESS] = 9.0}};
    return p;
}

static Status set(Instance i, const Reference *vr, size_t n, const double *value) {
    for (size_t k = 0; k < n; k++) ((Pendulum *)i)->values[vr[k]] = value[k];
    return OK;
}

static double partial(const double *v, Reference of, Reference by) {
    if (of == RATE) return by == RATE;
    if (of == DER_RATE)
        return by == ANGLE ? -v[STIFFNESS] * cos(v[ANGLE]) : by == RATE ? -1.0 : by == TORQUE ? 1.0 : 0.0;
    return by == ANGLE ? sin(v[ANGLE]) : 0.0; /* height = 1 - cos(angle) */
}

static Status derivative(Instance i, const Reference *of, size_t n, const Reference *by, size_t m, const double *seed,
                         double *out) {
    Pendulum *p = i;
    if (!p->ready) return ERROR;
    for (size_t row = 0; row < n; row++) {
        out[row] = 0.0;
        for (size_t k = 0; k < m; k++) out[row] += seed[k] * partial(p->values, of[row], by[k]);
    }
    return OK;
}

void F(FreeInstance)(Instance i) { free(i); }
Status F(Reset)(Instance i) { return as_new(i), OK; }
Status F(Terminate)(Instance i) { return (void)i, OK; }

#ifdef FMI3
Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible,
                                     fmi3Boolean log, fmi3Boolean events, fmi3Boolean early,
                                     const fmi3ValueReference intermediate[], size_t count,
                                     fmi3InstanceEnvironment environment, fmi3LogMessageCallback message,
                                     fmi3IntermediateUpdateCallback update) {
    (void)name, (void)token, (void)path, (void)visible, (void)log, (void)events, (void)early, (void)intermediate;
    (void)count, (void)environment, (void)message, (void)update;
    return as_new(malloc(sizeof(Pendulum)));
}
Status fmi3EnterInitializationMode(Instance i, fmi3Boolean b, fmi3Float64 t, fmi3Float64 s, fmi3Boolean d, fmi3Float64 e) {
    return (void)i, (void)b, (void)t, (void)s, (void)d, (void)e, OK;
}
Status fmi3ExitInitializationMode(Instance i) { return ((Pendulum *)i)->ready = 1, OK; }
Status fmi3SetFloat64(Instance i, const Reference vr[], size_t n, const fmi3Float64 value[], size_t m) {
    return m == n ? set(i, vr, n, value) : ERROR;
}
Status fmi3GetDirectionalDerivative(Instance i, const Reference of[], size_t n, const Reference by[], size_t m,
                                    const fmi3Float64 seed[], size_t seeds, fmi3Float64 out[], size_t outs) {
    return seeds == m && outs == n ? derivative(i, of, n, by, m, seed, out) : ERROR;
}
#else
Instance fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String path,
                         const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean log) {
    (void)name, (void)guid, (void)path, (void)callbacks, (void)visible, (void)log;
    return type == fmi2ModelExchange ? as_new(malloc(sizeof(Pendulum))) : NULL;
}
Status fmi2SetupExperiment(Instance i, fmi2Boolean b, fmi2Real t, fmi2Real s, fmi2Boolean d, fmi2Real e) {
    return (void)i, (void)b, (void)t, (void)s, (void)d, (void)e, OK;
}
Status fmi2EnterInitializationMode(Instance i) { return (void)i, OK; }
Status fmi2ExitInitializationMode(Instance i) { return (void)i, OK; }
/* The event iteration takes two calls. */
Status fmi2NewDiscreteStates(Instance i, fmi2EventInfo *info) {
    Pendulum *p = i;
    *info = (fmi2EventInfo){.newDiscreteStatesNeeded = !p->ready};
    return p->ready = 1, OK;
}
Status fmi2EnterContinuousTimeMode(Instance i) { return ((Pendulum *)i)->ready ? OK : ERROR; }
Status fmi2SetReal(Instance i, const Reference vr[], size_t n, const fmi2Real value[]) { return set(i, vr, n, value); }
Status fmi2GetDirectionalDerivative(Instance i, const Reference of[], size_t n, const Reference by[], size_t m,
                                    const fmi2Real seed[], fmi2Real out[]) {
    return derivative(i, of, n, by, m, seed, out);
}
#endif
