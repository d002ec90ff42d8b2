/* A mass on a spring that touches a second spring at x = CONTACT, and a clock that counts periods. It is correct, unless FMU_TRAITS lists
   faults, which concern its behaviour in time. The variants "harmless_..." are correct, but do what a careless check would report. */
#include "frame.h"

enum { K = 1, U, X, V, DER_X, DER_V, Y, COUNT, TOUCHES, TIME, SLEWED, ENTRIES };
#define CONTACT 0.01
#define PERIOD 0.05

struct Model {
    Fmu fmu;
    double x, v, k, u, debt;
    /* Earlier values, which some faults return instead of the current ones. */
    double old_y, old_der, old_u, latched;
    int ticks, count, touches, entries, seen, stale, handled, count_before, initialized, outdated;
};

static void start_spring(Model *m) { m->k = 40; }

/* Returns the acceleration; `touches` is whether the mass touches the second spring. */
static double acceleration(const Model *m, double x, double v, double u) {
    /* An input that acts from time zero on. */
    if (IS(harmless_source) && m->fmu.time < 0) u = 0;
    return (u - m->k * x - v - (m->touches ? 3 * m->k * (x - CONTACT) : 0)) / 0.1;
}

static double output(const Model *m) { return m->x + 2 * (IS(feedthrough_late) && m->fmu.cs ? m->old_u : m->u); }

/* Returns the output in Model Exchange. OpenModelica 1.12 calculates it only when derivatives are read. In 1.21, reading derivatives makes
   it count as calculated. */
static double output_read(Model *m) {
    if (IS(output_with_derivatives)) return m->old_y;
    if (!IS(output_outdated)) return output(m);
    if (m->outdated) m->old_y = output(m);
    m->outdated = 0;
    return m->old_y;
}

static double next_tick(const Model *m) {
    double periods = (m->fmu.time - (IS(clock_truncates) ? 0 : m->fmu.start)) / PERIOD;
    if (IS(clock_truncates)) return ((double)(int)(periods + (periods < 0 ? -1e-9 : 1e-9)) + 1) * PERIOD;
    return m->fmu.start + (floor(periods + 1e-9) + 1) * PERIOD;
}

static int ticks(const Model *m) {
    if (IS(clock_truncates)) return (int)((m->fmu.time + 1e-9) / PERIOD);
    return (int)floor((m->fmu.time - m->fmu.start) / PERIOD + 1e-9);
}

/* Updates the discrete states for the current time. */
static void discrete(Model *m) {
    int now = ticks(m);
    m->count += now != m->ticks;
    m->ticks = now;
    m->touches = m->x > CONTACT;
}

static double acceleration_read(const Model *m) {
    bool me = !m->fmu.cs;
    if (me && ((IS(derivative_of_old_mode) && m->stale) || (IS(event_mode_reads_old) && m->fmu.mode == EVENT))) return m->old_der;
    return acceleration(m, m->x, m->v, IS(input_unseen) && me && m->seen ? m->old_u : IS(event_input_latched) ? m->latched : m->u);
}

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    Fmu *f = &m->fmu;
    (void)kind;
    switch (vr) {
    case K:
        if (IS(parameter_single)) m->k = (float)m->k;
        return at_finite(to, &m->k, FIXED, -DBL_MAX);
    case U:
        if (IS(harmless_units)) m->u = m->u / 0.3048 * 0.3048;
        return at_finite(to, &m->u, INPUT, -DBL_MAX);
    case X: return calculated(f, to, m->x);
    case V: case DER_X: return calculated(f, to, m->v);
    case DER_V: return calculated(f, to, acceleration_read(m));
    case Y: return calculated(f, to, !f->cs ? output_read(m) : IS(output_late) ? m->old_y : IS(output_single) ? (float)output(m) : output(m));
    case TIME: return calculated(f, to, f->time);
    case SLEWED: return calculated(f, to, m->x + m->v);
    case COUNT: return counted(f, to, INTEGER, IS(count_late) && f->cs ? m->count_before : m->count);
    case ENTRIES: return counted(f, to, INTEGER, IS(harmless_entries) ? m->entries : 0);
    case TOUCHES: return counted(f, to, BOOLEAN, m->touches);
    default: return false;
    }
}

static bool take(Model *m, uint32_t vr, const void *value) {
    if (vr == UINT32_MAX) {
        m->x = IS(state_single) ? (float)((const double *)value)[0] : ((const double *)value)[0];
        m->v = ((const double *)value)[1];
        m->stale = m->seen = m->handled = 0;
        m->outdated = 1;
        return false;
    }
    if (vr != U) return true;
    m->outdated = 1;
    if (m->fmu.mode == EVENT && (m->fmu.cs ? IS(event_input_lost_stepped) : IS(event_input_lost))) return false;
    if (!m->seen) m->old_u = m->u;
    m->seen = 1;
    if (m->fmu.mode != EVENT) m->latched = *(const double *)value;
    return true;
}

/* Advances by a step of the Runge-Kutta method or of Euler's method. */
static void advance(Model *m, double h, bool euler) {
    double x = m->x, v = m->v, kx[4], kv[4];
    static const double nodes[] = {0, 0.5, 0.5, 1};
    for (int i = 0; i < (euler ? 1 : 4); i++) {
        double xi = x + (i ? h * nodes[i] * kx[i - 1] : 0), vi = v + (i ? h * nodes[i] * kv[i - 1] : 0);
        kx[i] = vi;
        kv[i] = acceleration(m, xi, vi, m->u);
    }
    m->x = x + (euler ? h * kx[0] : h / 6 * (kx[0] + 2 * kx[1] + 2 * kx[2] + kx[3]));
    m->v = v + (euler ? h * kv[0] : h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]));
}

/* Integrates in Co-Simulation with inner steps of at most 1 ms, which end at the ticks of the clock. */
static void integrate(Model *m, double end) {
    double inner = 1e-3, start = m->fmu.start;
    bool counts_steps = IS(remainder_dropped) || IS(remainder_repeated) || IS(harmless_carry);
    if (counts_steps) {
        double exact = (end - m->fmu.time + m->debt) / inner;
        long count = IS(remainder_repeated) ? (long)ceil(exact - 1e-6) : (long)(exact + 1e-6);
        m->debt = IS(harmless_carry) ? (exact - (double)count) * inner : 0;
        for (long i = 0; i < count; i++) advance(m, inner, false), discrete(m);
    } else if (IS(harmless_euler)) advance(m, end - m->fmu.time, true);
    else while (m->fmu.time < end - 1e-12) {
        double tick = start + (floor((m->fmu.time - start) / PERIOD + 1e-9) + 1) * PERIOD;
        double stop = fmin(fmin(end, m->fmu.time + inner), tick);
        advance(m, stop - m->fmu.time, false);
        m->fmu.time = stop;
        discrete(m);
    }
    m->fmu.time = end;
    if (counts_steps || IS(harmless_euler)) discrete(m);
    /* A solver with a tolerance has an error that depends on the steps. */
    if (IS(harmless_noise)) m->v += 1e-5 * sin(1e6 * m->fmu.time);
}

static int step(Model *m, double point, double size) {
    if (IS(negative_rejected) && point < 0) return ERROR;
    m->old_y = output(m);
    m->count_before = m->count;
    integrate(m, point + size);
    if (!m->seen) m->old_u = m->u;
    m->seen = 0;
    if (IS(late_is_nan) && point > 1e5) m->v = NAN;
    return OK;
}

static int enters(Model *m, int mode) {
    m->outdated = 1;
    if (mode == INITIALIZATION) m->ticks = ticks(m);
    if (mode == EVENT && m->fmu.mode != INITIALIZATION) m->old_der = acceleration_read(m), m->entries++;
    if (mode == CONTINUOUS && IS(derivative_of_old_mode)) m->stale = 1;
    if (m->fmu.mode == INITIALIZATION) discrete(m);
    if (mode != STEP || m->fmu.mode == INITIALIZATION) m->seen = 0;
    return OK;
}

static int update_model(Model *m, Update *to) {
    double periods = (m->fmu.time - m->fmu.start) / PERIOD;
    discrete(m);
    if (IS(event_counts_again) && periods > 0 && fabs(periods - round(periods)) < 1e-6 && m->handled++ > 0) m->count++;
    to->is_next = true;
    to->next = next_tick(m);
    return OK;
}

static size_t count(const Model *m, bool indicators) { (void)m, (void)indicators; return 2; }
static int derivatives(Model *m, double *to) {
    to[0] = m->v, to[1] = acceleration_read(m);
    if (IS(output_with_derivatives)) m->old_y = output(m);
    m->outdated = 0;
    return OK;
}
static void indicators(Model *m, double *to) {
    double distance = m->x - CONTACT;
    to[0] = IS(indicator_constant) ? 1 : IS(indicator_squared) ? distance * distance + 1e-3 : distance;
    to[1] = 1;
}

static double partial(const Model *m, uint32_t unknown, uint32_t known) {
    double feedthrough = IS(partial_without_input_initially) && m->fmu.mode == INITIALIZATION ? 0 : 2;
    int touches = IS(partial_of_old_mode) ? 0 : m->touches;
    if (known != X && known != V && known != U) return NAN;
    switch (unknown) {
    case DER_X: return known == V;
    case DER_V: return known == X ? -m->k * (touches ? 4 : 1) / 0.1 : known == V ? -10 : 10;
    case Y: return known == X ? 1 : known == U ? feedthrough : 0;
    case SLEWED: return known != U;
    default: return NAN;
    }
}

const Behaviour behaviour = {
    .token = "spring", .size = sizeof(Model), .saved = sizeof(Model), .state = offsetof(Model, x), .start = start_spring, .place = place,
    .take = take, .enter = enters, .step = step, .update = update_model, .count = count, .derivatives = derivatives,
    .indicators = indicators, .partial = partial,
};
