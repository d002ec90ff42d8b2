/* A mass on a spring that touches a second spring at x = CONTACT, and a clock that counts periods, as an FMU of FMI 2.0 or, with
   -DFMI=3, of FMI 3.0. It is correct, unless the environment variable SPRING_FAULTS lists faults, separated by commas. The faults
   concern the behaviour in time, so the FMU has few functions. The variants "harmless_..." are correct, but do what a careless check
   would report. */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

static const char *faults = "";

static bool is(const char *name) {
    const char *found = strstr(faults, name), end = found ? found[strlen(name)] : 'x';
    return found && (found == faults || found[-1] == ',') && (end == ',' || end == 0);
}
#define IS(name) is(#name)

__attribute__((constructor)) static void choose(void) {
    if (getenv("SPRING_FAULTS")) faults = getenv("SPRING_FAULTS");
}

#if FMI == 3
#define API(name) fmi3##name
typedef bool Flag;
#define SIZE , size_t values
#define SIZED (void)values;
#else
#define API(name) fmi2##name
typedef int Flag;
#define SIZE
#define SIZED
typedef struct { Flag again, terminate, nominals, values, defined; double next; } Event;
#endif

enum { K = 1, U, X, V, DER_X, DER_V, Y, COUNT, TOUCHES, TIME, SLEWED, ENTRIES };
enum { STARTED, INITIALIZATION, EVENT, RUNNING };
#define CONTACT 0.01
#define PERIOD 0.05

typedef struct {
    double time, k, u, x, v, start, debt;
    /* Earlier values, which some faults return instead of the current ones. */
    double old_y, old_der, old_u, latched;
    int ticks, count, touches, entries, mode, cs, dirty, seen, event_used, stale, handled, count_before;
} Model;

/* Returns the acceleration; `touches` is whether the mass touches the second spring. */
static double acceleration(const Model *m, double x, double v, double u, int touches) {
    /* An input that acts from time zero on. */
    if (IS(harmless_source) && m->time < 0) u = 0;
    return (u - m->k * x - v - (touches ? 3 * m->k * (x - CONTACT) : 0)) / 0.1;
}

static double output(const Model *m) {
    double u = IS(feedthrough_late) && m->cs ? m->old_u : m->u;
    return m->x + 2 * u;
}

static double slewed(const Model *m) {
    return m->x + m->v;
}

static double next_tick(const Model *m) {
    double periods = (m->time - (IS(clock_truncates) ? 0 : m->start)) / PERIOD;
    if (IS(clock_truncates)) return ((double)(int)(periods + (periods < 0 ? -1e-9 : 1e-9)) + 1) * PERIOD;
    return m->start + (floor(periods + 1e-9) + 1) * PERIOD;
}

static int ticks_until(const Model *m, double time) {
    if (IS(clock_truncates)) return (int)((time + 1e-9) / PERIOD);
    return (int)floor((time - m->start) / PERIOD + 1e-9);
}

/* Updates the discrete states for the current time. */
static void discrete(Model *m) {
    int ticks = ticks_until(m, m->time);
    m->count += ticks != m->ticks;
    m->ticks = ticks;
    m->touches = m->x > CONTACT;
}

static double value(Model *m, uint32_t vr) {
    switch (vr) {
    case K: return IS(parameter_single) ? (float)m->k : m->k;
    case U: return IS(harmless_units) ? m->u / 0.3048 * 0.3048 : m->u;
    case X: return m->x;
    case V: return m->v;
    case DER_X: return m->v;
    case DER_V:
        if (IS(derivative_of_old_mode) && !m->cs && m->stale) return m->old_der;
        if (IS(event_mode_reads_old) && m->mode == EVENT && !m->cs) return m->old_der;
        if (IS(input_unseen) && !m->cs && m->seen) return acceleration(m, m->x, m->v, m->old_u, m->touches);
        return acceleration(m, m->x, m->v, IS(event_input_latched) ? m->latched : m->u, m->touches);
    case Y:
        if (IS(output_late) && m->cs) return m->old_y;
        if (IS(output_single) && m->cs) return (float)output(m);
        return output(m);
    case TIME: return m->time;
    case SLEWED: return slewed(m);
    default: return NAN;
    }
}

static double indicator(const Model *m) {
    if (IS(indicator_constant)) return 1;
    if (IS(indicator_squared)) return (m->x - CONTACT) * (m->x - CONTACT) + 1e-3;
    return m->x - CONTACT;
}

static int get_real(void *c, const uint32_t *vr, size_t n, double *to SIZE) {
    SIZED
    for (size_t i = 0; i < n; i++) to[i] = value(c, vr[i]);
    return 0;
}

static int set_real(void *c, const uint32_t *vr, size_t n, const double *from SIZE) {
    Model *m = c;
    SIZED
    for (size_t i = 0; i < n; i++) {
        if (vr[i] == K && m->mode < EVENT) m->k = from[i];
        else if (vr[i] == U) {
            if (IS(event_input_lost) && m->mode == EVENT && !m->cs) continue;
            if (IS(event_input_lost_stepped) && m->mode == EVENT && m->cs) continue;
            if (!m->seen) m->old_u = m->u;
            m->seen = 1;
            m->u = from[i];
            if (m->mode != EVENT) m->latched = from[i];
        } else return 3;
    }
    return 0;
}

static int get_integer(void *c, const uint32_t *vr, size_t n, int32_t *to SIZE) {
    Model *m = c;
    SIZED
    for (size_t i = 0; i < n; i++)
        to[i] = vr[i] == ENTRIES ? (IS(harmless_entries) ? m->entries : 0) : IS(count_late) && m->cs ? m->count_before : m->count;
    return 0;
}

static int get_boolean(void *c, const uint32_t *vr, size_t n, Flag *to SIZE) {
    SIZED
    (void)vr;
    for (size_t i = 0; i < n; i++) to[i] = ((Model *)c)->touches;
    return 0;
}

/* Advances by a step of the Runge-Kutta method or of Euler's method. */
static void advance(Model *m, double h, bool euler) {
    double x = m->x, v = m->v, kx[4], kv[4];
    static const double at[] = {0, 0.5, 0.5, 1};
    for (int i = 0; i < (euler ? 1 : 4); i++) {
        double xi = x + (i ? h * at[i] * kx[i - 1] : 0), vi = v + (i ? h * at[i] * kv[i - 1] : 0);
        kx[i] = vi;
        kv[i] = acceleration(m, xi, vi, m->u, m->touches);
    }
    m->x = x + (euler ? h * kx[0] : h / 6 * (kx[0] + 2 * kx[1] + 2 * kx[2] + kx[3]));
    m->v = v + (euler ? h * kv[0] : h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]));
}

/* Integrates in Co-Simulation with inner steps of at most 1 ms, which end at the ticks of the clock. */
static void integrate(Model *m, double end) {
    double size = end - m->time, inner = 1e-3;
    if (IS(harmless_euler)) { advance(m, size, true); m->time = end; discrete(m); return; }
    if (IS(remainder_dropped) || IS(remainder_repeated) || IS(harmless_carry)) {
        double exact = (size + m->debt) / inner;
        long count = IS(remainder_repeated) ? (long)ceil(exact - 1e-6) : (long)(exact + 1e-6);
        m->debt = IS(harmless_carry) ? (exact - (double)count) * inner : 0;
        for (long i = 0; i < count; i++) advance(m, inner, false), discrete(m);
        m->time = end;
        discrete(m);
        return;
    }
    while (m->time < end - 1e-12) {
        double tick = m->start + (floor((m->time - m->start) / PERIOD + 1e-9) + 1) * PERIOD;
        double stop = fmin(fmin(end, m->time + inner), tick);
        advance(m, stop - m->time, false);
        m->time = stop;
        discrete(m);
    }
    m->time = end;
    /* A solver with a tolerance has an error that depends on the steps. */
    if (IS(harmless_noise)) m->v += 1e-5 * sin(1e6 * m->time);
}

static int step(void *c, double point, double size) {
    Model *m = c;
    if (m->mode != RUNNING || !(size > 0)) return 3;
    if (IS(negative_rejected) && point < 0) return 3;
    m->old_y = output(m);
    m->count_before = m->count;
    integrate(m, point + size);
    if (!m->seen) m->old_u = m->u;
    m->seen = 0;
    if (IS(late_is_nan) && point > 1e5) m->v = NAN;
    return 0;
}

static void *make(int cs) {
    Model *m = calloc(1, sizeof *m);
    m->k = 40;
    m->cs = cs;
    return m;
}

static int enter(void *c, double start) {
    Model *m = c;
    m->time = m->start = start;
    m->ticks = ticks_until(m, start);
    m->mode = INITIALIZATION;
    return 0;
}

static void update(Model *m, double *next) {
    discrete(m);
    if (IS(event_counts_again) && m->time > m->start && fabs((m->time - m->start) / PERIOD - round((m->time - m->start) / PERIOD)) < 1e-6 && m->handled++ > 0) m->count++;
    *next = next_tick(m);
}

#define EXPORT(name) int API(name)
#if FMI == 3
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging, void *environment, void *log) {
    (void)name; (void)token; (void)resources; (void)visible; (void)logging; (void)environment; (void)log;
    return make(0);
}
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool event_mode) {
    Model *m = make(1);
    (void)name; (void)token; (void)resources; (void)visible; (void)logging;
    m->event_used = event_mode;
    return m;
}
EXPORT(EnterInitializationMode)(void *c, bool defined, double tolerance, double start) { (void)defined; (void)tolerance; return enter(c, start); }
EXPORT(GetFloat64)(void *c, const uint32_t *vr, size_t n, double *to, size_t values) { return get_real(c, vr, n, to, values); }
EXPORT(SetFloat64)(void *c, const uint32_t *vr, size_t n, const double *from, size_t values) { return set_real(c, vr, n, from, values); }
EXPORT(GetInt32)(void *c, const uint32_t *vr, size_t n, int32_t *to, size_t values) { return get_integer(c, vr, n, to, values); }
EXPORT(GetBoolean)(void *c, const uint32_t *vr, size_t n, bool *to, size_t values) { return get_boolean(c, vr, n, to, values); }
EXPORT(DoStep)(void *c, double point, double size, bool no_set, bool *event, bool *terminate, bool *early, double *last) {
    (void)no_set;
    *event = *terminate = *early = false;
    *last = point + size;
    return step(c, point, size);
}
EXPORT(UpdateDiscreteStates)(void *c, bool *again, bool *terminate, bool *nominals, bool *values, bool *defined, double *next) {
    *again = *terminate = *nominals = *values = false;
    *defined = true;
    update(c, next);
    return 0;
}
EXPORT(EnterStepMode)(void *c) { ((Model *)c)->mode = RUNNING; return 0; }
EXPORT(GetDirectionalDerivative)(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns, double *to, size_t nt) {
    (void)ns; (void)nt;
#else
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type) { (void)name; return make(type == 1); }
EXPORT(SetupExperiment)(void *c, int defined, double tolerance, double start) {
    (void)defined; (void)tolerance;
    if (IS(setup_rejects_negative) && start < 0) return 3;
    ((Model *)c)->time = start;
    return 0;
}
EXPORT(EnterInitializationMode)(void *c) { return enter(c, ((Model *)c)->time); }
EXPORT(GetReal)(void *c, const uint32_t *vr, size_t n, double *to) { return get_real(c, vr, n, to); }
EXPORT(SetReal)(void *c, const uint32_t *vr, size_t n, const double *from) { return set_real(c, vr, n, from); }
EXPORT(GetInteger)(void *c, const uint32_t *vr, size_t n, int32_t *to) { return get_integer(c, vr, n, to); }
EXPORT(GetBoolean)(void *c, const uint32_t *vr, size_t n, int *to) { return get_boolean(c, vr, n, to); }
EXPORT(DoStep)(void *c, double point, double size) { return step(c, point, size); }
EXPORT(NewDiscreteStates)(void *c, Event *event) {
    memset(event, 0, sizeof *event);
    event->defined = 1;
    update(c, &event->next);
    return 0;
}
EXPORT(GetDirectionalDerivative)(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, double *to) {
#endif
    const Model *m = c;
    double feedthrough = IS(partial_without_input_initially) && m->mode == INITIALIZATION ? 0 : 2;
    int touches = IS(partial_of_old_mode) ? 0 : m->touches;
    for (size_t i = 0; i < nu; i++) {
        to[i] = 0;
        for (size_t j = 0; j < nk; j++) {
            double d = 0;
            if (u[i] == DER_X) d = k[j] == V;
            if (u[i] == DER_V) d = k[j] == X ? -m->k * (touches ? 4 : 1) / 0.1 : k[j] == V ? -10 : k[j] == U ? 10 : 0;
            if (u[i] == Y) d = k[j] == X ? 1 : k[j] == U ? feedthrough : 0;
            if (u[i] == SLEWED) d = k[j] == X || k[j] == V;
            to[i] += d * seed[j];
        }
    }
    return 0;
}
EXPORT(ExitInitializationMode)(void *c) {
    Model *m = c;
    m->mode = m->cs && !m->event_used ? RUNNING : EVENT;
    m->seen = 0;
    discrete(m);
    return 0;
}
EXPORT(Terminate)(void *c) { (void)c; return 0; }
EXPORT(Reset)(void *c) { Model *m = c; int cs = m->cs; memset(m, 0, sizeof *m); m->k = 40; m->cs = cs; return 0; }
void API(FreeInstance)(void *c) { free(c); }
EXPORT(SetTime)(void *c, double time) {
    Model *m = c;
    m->time = time;
    m->handled = 0;
    return 0;
}
EXPORT(SetContinuousStates)(void *c, const double *x, size_t n) {
    Model *m = c;
    (void)n;
    m->x = IS(state_single) ? (float)x[0] : x[0];
    m->v = x[1];
    m->stale = 0;
    m->seen = 0;
    return 0;
}
EXPORT(GetContinuousStates)(void *c, double *x, size_t n) { Model *m = c; (void)n; x[0] = m->x; x[1] = m->v; return 0; }
EXPORT(GetNominalsOfContinuousStates)(void *c, double *x, size_t n) { (void)c; (void)n; x[0] = x[1] = 1; return 0; }
static int get_derivatives(void *c, double *x, size_t n) { (void)n; x[0] = value(c, DER_X); x[1] = value(c, DER_V); return 0; }
EXPORT(GetDerivatives)(void *c, double *x, size_t n) { return get_derivatives(c, x, n); }
EXPORT(GetContinuousStateDerivatives)(void *c, double *x, size_t n) { return get_derivatives(c, x, n); }
EXPORT(GetEventIndicators)(void *c, double *z, size_t n) { z[0] = indicator(c); if (n > 1) z[1] = 1; return 0; }
EXPORT(GetNumberOfContinuousStates)(void *c, size_t *n) { (void)c; *n = 2; return 0; }
EXPORT(GetNumberOfEventIndicators)(void *c, size_t *n) { (void)c; *n = 2; return 0; }
EXPORT(EnterEventMode)(void *c) {
    Model *m = c;
    m->old_der = value(m, DER_V);
    m->mode = EVENT;
    m->entries++;
    m->seen = 0;
    return 0;
}
EXPORT(EnterContinuousTimeMode)(void *c) {
    Model *m = c;
    m->mode = RUNNING;
    if (IS(derivative_of_old_mode)) m->stale = 1;
    m->seen = 0;
    return 0;
}
EXPORT(CompletedIntegratorStep)(void *c, Flag no_set, Flag *event, Flag *terminate) {
    (void)c;
    (void)no_set;
    *event = *terminate = 0;
    return 0;
}
EXPORT(SetDebugLogging)(void *c) { (void)c; return 0; }
