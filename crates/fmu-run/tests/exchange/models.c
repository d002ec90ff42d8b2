/* Test models for Model Exchange, of FMI 2.0 and 3.0. The guid selects the model. The models reject many calls that the standard does not
 * allow in their mode, such as setting discrete inputs in Continuous-Time Mode or states in Event Mode. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#undef fmi2TypesPlatform
#include "fmi3Functions.h"

#define MODELS(M) \
    M(ball)      /* x'' = -9.81 from x = 1; at x <= 0 the speed is reversed and multiplied by p, and the height stays as it is. */ \
    M(zeno)      /* The ball, but its height becomes 0 at a hit. It hits the ground infinitely often before 2.56 s. */ \
    M(stair)     /* hits = number of full seconds; ends the simulation when hits >= p. It has no states. */ \
    M(vanderpol) /* x0' = x1, x1' = p (1 - x0^2) x1 - x0, from (2, 0). */ \
    M(dahlquist) /* x' = -p x, from x = 1. */ \
    M(lag)       /* x' = u + n - p x, from x = 0. */ \
    M(nan)       /* x' = 1, and NaN from t = 0.5 on. */ \
    M(root)      /* x' = -sqrt(x), from x = 1; x < 0 is discarded. */ \
    M(zero)      /* x' = -x, with an event indicator that is always 0. */ \
    M(endless)   /* The event at t = 0.5 requests another iteration after each iteration. */ \
    M(relay)     /* x' = -1 if x > 0, else 1: after 1 s the sign of x changes again and again. */ \
    M(announce)  /* From t = 0.5 on, each event announces another one at the same time. */ \
    M(swap)      /* x' = x, from x = 1. After the first step with |x| > 2 it requests an event, at which x becomes -x and y = -x. */ \
    M(stale)     /* x' = -x; y is calculated only when the derivatives are read. */ \
    M(steady)    /* x' = -p x; requests an event after each step, at which nothing changes. */ \
    M(turn)      /* x' = 1. After the first step with x > 1.5 it requests an event, from which on x' = -1. */ \
    M(picky)     /* x' = -x; rejects the nominal values without a message if p = 2. */ \
    M(ending)    /* x' = -x; ends the simulation at the event at x = 0.5. */ \
    M(failing)   /* x' = 1; fails from t = 0.5 on. */

#define ITEM(name) name##_,
enum { MODELS(ITEM) COUNT };
#define NAME(name) #name,
static const char *const NAMES[] = {MODELS(NAME)};

/* Value references: an input, its time derivative, a discrete input, a parameter, outputs, states and derivatives of states. */
enum { U = 1, W, N, P, Y, RATE, HITS, X0, X1, D0, D1 };
enum Mode { START, INITIALIZATION, EVENT, CONTINUOUS };

typedef struct {
    int model;
    enum Mode mode;
    fmi2CallbackFunctions callbacks;
    fmi3LogMessageCallback log3;
    void *environment;
    char *name;
    double time, x[2], u, w, p, y;
    int32_t n, hits;
    int above, sign, wants, is_fmi3;
} Model;

typedef struct {
    int again, terminate, nominals, states, is_next;
    double next;
} Update;

static int failed(Model *m, int status, const char *why) {
    if (m->is_fmi3) {
        m->log3(m->environment, (fmi3Status)status, "logStatusError", why);
    } else {
        m->callbacks.logger(m->callbacks.componentEnvironment, m->name, (fmi2Status)status, "logStatusError", why);
    }
    return status;
}

static int wrong(Model *m, const char *call) {
    static const char *const MODES[] = {"at the start", "in Initialization Mode", "in Event Mode", "in Continuous-Time Mode"};
    char text[100];
    snprintf(text, sizeof text, "%s is not allowed %s", call, MODES[m->mode]);
    return failed(m, 3, text);
}

static int states(const Model *m) {
    return m->model == stair_ ? 0 : m->model == ball_ || m->model == zeno_ || m->model == vanderpol_ ? 2 : 1;
}

static void start(Model *m) {
    double p = m->model == ball_ || m->model == zeno_ ? 0.7 : m->model == stair_ ? 10 : 1;
    m->mode = START;
    m->time = m->u = m->w = m->x[1] = m->y = 0;
    m->n = m->hits = m->wants = 0;
    m->sign = 1;
    m->p = p;
    m->x[0] = m->model == lag_ ? 0 : m->model == vanderpol_ ? 2 : 1;
}

static Model *made(const char *guid, const char *name) {
    Model *m = calloc(1, sizeof *m);
    for (m->model = 0; m->model < COUNT; m->model++)
        if (strlen(guid) == strlen(NAMES[m->model]) + 2 && !strncmp(guid + 1, NAMES[m->model], strlen(NAMES[m->model]))) break;
    if (m->model == COUNT) { free(m); return NULL; }
    m->name = strdup(name);
    start(m);
    return m;
}

static double indicator(const Model *m) {
    switch (m->model) {
    case ball_: case zeno_: return m->x[0];
    case relay_: return m->x[0];
    case ending_: return m->x[0] - 0.5;
    default: return 0;
    }
}

static int derivatives(Model *m, double d[]) {
    const double *x = m->x;
    d[0] = 0;
    switch (m->model) {
    case ball_: case zeno_: d[0] = x[1]; d[1] = -9.81; break;
    case vanderpol_: d[0] = x[1]; d[1] = m->p * (1 - x[0] * x[0]) * x[1] - x[0]; break;
    case dahlquist_: case steady_: d[0] = -m->p * x[0]; break;
    case lag_: d[0] = m->u + m->n - m->p * x[0]; break;
    case nan_: d[0] = m->time < 0.5 ? 1 : NAN; break;
    case root_:
        if (x[0] < 0) return failed(m, 2, "the root of a negative number");
        d[0] = -sqrt(x[0]);
        break;
    case relay_: d[0] = m->above ? -1 : 1; break;
    case swap_: d[0] = x[0]; break;
    case turn_: d[0] = m->sign; break;
    case stale_: d[0] = -x[0]; m->y = x[0]; break;
    case failing_:
        if (m->time >= 0.5) return failed(m, 3, "the valve is stuck");
        d[0] = 1;
        break;
    case stair_: break;
    default: d[0] = -x[0];
    }
    return 0;
}

static int update(Model *m, Update *u) {
    if (m->mode != EVENT) return wrong(m, "an update of discrete states");
    switch (m->model) {
    case ball_: case zeno_:
        if (m->x[0] <= 0 && m->x[1] < 0) { m->x[1] *= -m->p; m->hits++; u->states = 1; if (m->model == zeno_) m->x[0] = 0; }
        break;
    case stair_:
        m->hits = (int32_t)floor(m->time + 1e-9);
        u->is_next = 1;
        u->next = m->hits + 1;
        u->terminate = m->hits >= m->p;
        break;
    case endless_:
        u->again = m->time >= 0.5;
        u->is_next = m->time < 0.5;
        u->next = 0.5;
        break;
    case announce_:
        u->is_next = 1;
        u->next = m->time < 0.5 ? 0.5 : m->time;
        break;
    case swap_:
        if (m->wants) { m->x[0] *= -1; m->sign *= -1; m->hits++; u->states = u->nominals = 1; m->wants = 0; }
        break;
    case steady_: m->hits += m->wants; m->wants = 0; break;
    case turn_:
        if (m->wants) { m->sign = -1; m->hits++; m->wants = 0; }
        break;
    case ending_: u->terminate = m->x[0] <= 0.5; break;
    default: break;
    }
    m->above = indicator(m) > 0;
    return 0;
}

static int set_real(Model *m, unsigned vr, double value) {
    switch (vr) {
    case U: m->u = value; return 0;
    case W: m->w = value; return 0;
    case P:
        if (m->mode != START) return wrong(m, "setting p");
        m->p = value;
        return 0;
    case X0: case X1:
        if (m->mode != START && m->mode != INITIALIZATION) return wrong(m, "setting a start value");
        m->x[vr - X0] = value;
        return 0;
    default: return failed(m, 3, "no such input");
    }
}

static int get_real(Model *m, unsigned vr, double *value) {
    double d[2] = {0, 0};
    switch (vr) {
    case U: *value = m->u; return 0;
    case W: case RATE: *value = m->w; return 0;
    case P: *value = m->p; return 0;
    case Y: *value = m->model == stale_ ? m->y : (m->model == swap_ ? m->sign : 1) * m->x[0]; return 0;
    case X0: case X1: *value = m->x[vr - X0]; return 0;
    case D0: case D1: {
        int status = derivatives(m, d);
        *value = d[vr - D0];
        return status;
    }
    default: return failed(m, 3, "no such variable");
    }
}

static int set_n(Model *m, int32_t value) {
    if (m->mode == CONTINUOUS) return wrong(m, "setting the discrete input n");
    m->n = value;
    return 0;
}

static int set_time(Model *m, double time) {
    if (m->mode != CONTINUOUS) return wrong(m, "setting the time");
    m->time = time;
    return 0;
}

static int set_states(Model *m, const double x[], size_t n) {
    if (m->mode != CONTINUOUS) return wrong(m, "setting states");
    if ((int)n != states(m)) return failed(m, 3, "wrong number of states");
    memcpy(m->x, x, n * sizeof *x);
    return 0;
}

static int completed(Model *m, int *event) {
    if (m->mode != CONTINUOUS) return wrong(m, "completing a step");
    m->wants |= m->model == swap_ && fabs(m->x[0]) > 2 && m->hits == 0;
    m->wants |= m->model == steady_ || (m->model == turn_ && m->x[0] > 1.5 && m->hits == 0);
    *event = m->wants;
    return 0;
}

static int go(Model *m, enum Mode from, enum Mode to, const char *call) {
    if (m->mode != from) return wrong(m, call);
    m->mode = to;
    return 0;
}

static void jacobian(const Model *m, const double seed[], double out[]) {
    const double *x = m->x;
    out[0] = seed[1];
    out[1] = (-2 * m->p * x[0] * x[1] - 1) * seed[0] + m->p * (1 - x[0] * x[0]) * seed[1];
}

static int directional(Model *m, const unsigned unknown[], size_t n, const unsigned known[], size_t n_known, const double seed[],
                       double values[]) {
    double all[2] = {0, 0}, out[2];
    if (m->model != vanderpol_) return failed(m, 3, "no directional derivatives");
    for (size_t i = 0; i < n_known; i++) all[known[i] - X0] = seed[i];
    jacobian(m, all, out);
    for (size_t i = 0; i < n; i++) values[i] = out[unknown[i] - D0];
    return 0;
}

/* FMI 2.0. */
#define M2 Model *m = (Model *)c
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    Model *m = type == fmi2ModelExchange ? made(guid, name) : NULL;
    (void)resources, (void)visible, (void)logging;
    if (m) m->callbacks = *callbacks;
    return m;
}
void fmi2FreeInstance(fmi2Component c) { M2; free(m->name); free(m); }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real begin, fmi2Boolean has_stop,
                               fmi2Real stop) {
    M2;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->time = begin;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { M2; return (fmi2Status)go(m, START, INITIALIZATION, "initialization"); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { M2; return (fmi2Status)go(m, INITIALIZATION, EVENT, "its end"); }
fmi2Status fmi2EnterEventMode(fmi2Component c) { M2; return (fmi2Status)go(m, CONTINUOUS, EVENT, "Event Mode"); }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { M2; return (fmi2Status)go(m, EVENT, CONTINUOUS, "Continuous-Time Mode"); }
fmi2Status fmi2Terminate(fmi2Component c) { (void)c; return fmi2OK; }
fmi2Status fmi2Reset(fmi2Component c) { start((Model *)c); return fmi2OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    Update u = {0};
    fmi2Status status = (fmi2Status)update((Model *)c, &u);
    info->newDiscreteStatesNeeded = u.again;
    info->terminateSimulation = u.terminate;
    info->nominalsOfContinuousStatesChanged = u.nominals;
    info->valuesOfContinuousStatesChanged = u.states;
    info->nextEventTimeDefined = u.is_next;
    info->nextEventTime = u.next;
    return status;
}
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set, fmi2Boolean *event, fmi2Boolean *terminate) {
    (void)no_set;
    *terminate = fmi2False;
    return (fmi2Status)completed((Model *)c, event);
}
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { return (fmi2Status)set_time((Model *)c, time); }
fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) { return (fmi2Status)set_states((Model *)c, x, n); }
fmi2Status fmi2GetContinuousStates(fmi2Component c, fmi2Real x[], size_t n) { M2; memcpy(x, m->x, n * sizeof *x); return fmi2OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c, fmi2Real d[], size_t n) {
    (void)n;
    return (fmi2Status)derivatives((Model *)c, d);
}
fmi2Status fmi2GetEventIndicators(fmi2Component c, fmi2Real z[], size_t n) { M2; if (n) z[0] = indicator(m); return fmi2OK; }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c, fmi2Real x[], size_t n) {
    M2;
    if (m->model == picky_ && m->p == 2) return fmi2Error;
    for (size_t i = 0; i < n; i++) x[i] = m->model == swap_ && m->hits ? 100 : 1;
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    int status = 0;
    for (size_t i = 0; i < n && !status; i++) status = set_real((Model *)c, vr[i], value[i]);
    return (fmi2Status)status;
}
fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    int status = 0;
    for (size_t i = 0; i < n && !status; i++) status = get_real((Model *)c, vr[i], &value[i]);
    return (fmi2Status)status;
}
fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    (void)vr;
    return n ? (fmi2Status)set_n((Model *)c, value[0]) : fmi2OK;
}
fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    M2;
    for (size_t i = 0; i < n; i++) value[i] = vr[i] == N ? m->n : m->hits;
    return fmi2OK;
}
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n, const fmi2ValueReference known[],
                                        size_t n_known, const fmi2Real seed[], fmi2Real values[]) {
    return (fmi2Status)directional((Model *)c, unknown, n, known, n_known, seed, values);
}

/* FMI 3.0. */
fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                          fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    Model *m = made(token, name);
    (void)resources, (void)visible, (void)logging;
    if (m) { m->is_fmi3 = 1; m->environment = environment; m->log3 = log; }
    return m;
}
void fmi3FreeInstance(fmi3Instance c) { fmi2FreeInstance(c); }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 begin,
                                       fmi3Boolean has_stop, fmi3Float64 stop) {
    M2;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->time = begin;
    return (fmi3Status)go(m, START, INITIALIZATION, "initialization");
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (fmi3Status)fmi2ExitInitializationMode(c); }
fmi3Status fmi3EnterEventMode(fmi3Instance c) { return (fmi3Status)fmi2EnterEventMode(c); }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c) { return (fmi3Status)fmi2EnterContinuousTimeMode(c); }
fmi3Status fmi3Terminate(fmi3Instance c) { (void)c; return fmi3OK; }
fmi3Status fmi3Reset(fmi3Instance c) { start((Model *)c); return fmi3OK; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c, fmi3Boolean *again, fmi3Boolean *terminate, fmi3Boolean *nominals,
                                    fmi3Boolean *changed, fmi3Boolean *is_next, fmi3Float64 *next) {
    Update u = {0};
    fmi3Status status = (fmi3Status)update((Model *)c, &u);
    *again = u.again;
    *terminate = u.terminate;
    *nominals = u.nominals;
    *changed = u.states;
    *is_next = u.is_next;
    *next = u.next;
    return status;
}
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c, fmi3Boolean no_set, fmi3Boolean *event, fmi3Boolean *terminate) {
    int wants = 0, status = completed((Model *)c, &wants);
    (void)no_set;
    *event = wants;
    *terminate = 0;
    return (fmi3Status)status;
}
fmi3Status fmi3SetTime(fmi3Instance c, fmi3Float64 time) { return (fmi3Status)set_time((Model *)c, time); }
fmi3Status fmi3SetContinuousStates(fmi3Instance c, const fmi3Float64 x[], size_t n) { return (fmi3Status)set_states((Model *)c, x, n); }
fmi3Status fmi3GetContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) { return (fmi3Status)fmi2GetContinuousStates(c, x, n); }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c, fmi3Float64 d[], size_t n) { return (fmi3Status)fmi2GetDerivatives(c, d, n); }
fmi3Status fmi3GetEventIndicators(fmi3Instance c, fmi3Float64 z[], size_t n) { return (fmi3Status)fmi2GetEventIndicators(c, z, n); }
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c, fmi3Float64 x[], size_t n) {
    return (fmi3Status)fmi2GetNominalsOfContinuousStates(c, x, n);
}
fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2SetReal(c, vr, n, value);
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2GetReal(c, vr, n, value);
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2SetInteger(c, vr, n, value);
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2GetInteger(c, vr, n, value);
}
fmi3Status fmi3GetDirectionalDerivative(fmi3Instance c, const fmi3ValueReference unknown[], size_t n, const fmi3ValueReference known[],
                                        size_t n_known, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 values[], size_t n_values) {
    (void)n_seed, (void)n_values;
    return (fmi3Status)directional((Model *)c, unknown, n, known, n_known, seed, values);
}
