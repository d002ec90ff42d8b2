/* x' = u from x = 0, with a clock of each type of FMI 3.0. Clocked variables can only be set and read while their clock is active, and each
   counts the ticks of its clock. Without the traits below, the clocks are correct.

   The model has a state event at x = 0.5 and a time event at t = 0.45. It rejects a step of Co-Simulation beyond the time event. */
#define CLOCKS
#include "frame.h"

/* Value references: an input, a discrete input, the outputs x, the number of state events, of time events, and of changes of discrete inputs,
   the derivative, and a second discrete input. */
enum { U = 1, N, X, HITS, TIMED, SEEN, DX, LARGE };
/* The clocks: with an interval in the description, of 1/3 s as a fraction, the same with the interval of the parameter PERIOD, with the
   intervals 0.1 s, 0.2 s, 0.3 s and so on, 0.25 s after each tick of PRESSED, triggered by the importer, active at every third tick of
   TICK, and active in the next iteration of an event in which OUT was active. */
enum { TICK = 10, THIRD, TUNED, CHANGING, DOWN, PRESSED, OUT, NEXT, CLOCK_END };
/* The numbers of their ticks, in the same order. */
enum { COUNTS = 20, SAMPLE = 30, SUM, INSTANT, SAMPLED, PERIOD, VECTOR };
enum { COUNT = CLOCK_END - TICK };

struct Model {
    Fmu fmu;
    double x, u, sample, sum, period, vector[2];
    int64_t large, large_before;
    int32_t n, before, hits, timed, seen, counts[COUNT];
    /* The interval of TUNED that the importer knows. */
    double known;
    int active[COUNT], evaluated, follows;
    bool is_down;
};

static void set_start(Model *m) { m->period = 0.4; }

static int index_of(uint32_t vr) { return (int)vr - TICK; }
static bool is_active(const Model *m, int clock) { return m->active[index_of((uint32_t)clock)]; }

/* Calculates the clocked variables once in each iteration of an event, when the first of them is read, or else at its end. */
static void evaluate(Model *m) {
    if (m->evaluated) return;
    m->evaluated = 1;
    m->active[index_of(NEXT)] = m->follows;
    m->follows = 0;
    if (is_active(m, TICK)) {
        m->sum += m->sample;
        if ((m->counts[0] + 1) % 3 == 0) m->active[index_of(OUT)] = m->follows = 1;
    }
    if (is_active(m, PRESSED)) m->is_down = true;
    for (int k = 0; k < COUNT; k++) m->counts[k] += m->active[k];
}

static bool clocked(Model *m, int clock) {
    if (!(m->fmu.mode & (INITIALIZATION | EVENT)) || (m->fmu.mode == EVENT && !is_active(m, clock))) return false;
    evaluate(m);
    return true;
}

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    (void)kind;
    if (vr >= COUNTS && vr < COUNTS + COUNT) return clocked(m, (int)(vr - COUNTS + TICK)) && at(to, INTEGER, &m->counts[vr - COUNTS], 0);
    switch (vr) {
    case U: return at_real(to, &m->u, INPUT);
    case N: return at(to, INTEGER, &m->n, START | INITIALIZATION | EVENT);
    case LARGE: return at(to, LONG, &m->large, START | INITIALIZATION | EVENT);
    case X: return at_real(to, &m->x, 0);
    case DX: return calculated(&m->fmu, to, m->u);
    case HITS: return at(to, INTEGER, &m->hits, 0);
    case TIMED: return at(to, INTEGER, &m->timed, 0);
    case SEEN: return at(to, INTEGER, &m->seen, 0);
    case PERIOD: return at_real(to, &m->period, INPUT);
    /* The importer sets the sample before anything is calculated from it. */
    case SAMPLE: return (m->fmu.mode != EVENT || is_active(m, TICK)) && at_real(to, &m->sample, DISCRETE);
    case SUM: return clocked(m, TICK) && at_real(to, &m->sum, 0);
    case INSTANT: return clocked(m, TICK) && calculated(&m->fmu, to, m->fmu.time);
    case SAMPLED: return clocked(m, TICK) && calculated(&m->fmu, to, m->x);
    case VECTOR:
        if (!clocked(m, PRESSED)) return false;
        m->vector[0] = m->x, m->vector[1] = -m->x;
        return at_real(to, m->vector, 0), to->count = 2, true;
    default: return false;
    }
}

static size_t count(const Model *m, bool indicators) { (void)m, (void)indicators; return 1; }
static int derivatives(Model *m, double *to) { *to = m->u; return OK; }
static void indicators(Model *m, double *to) { *to = m->x - 0.5 - (m->hits > 0); }

static int update_model(Model *m, Update *to) {
    const double due = 0.45;
    evaluate(m);
    memset(m->active, 0, sizeof m->active);
    m->evaluated = 0;
    if (m->x >= 0.5 && !m->hits) m->hits++;
    if (m->fmu.time >= due && !m->timed) m->timed++;
    m->seen += m->n != m->before || m->large != m->large_before;
    m->before = m->n, m->large_before = m->large;
    to->again = m->follows || IS(endless);
    to->is_next = !m->timed || IS(next_nan);
    to->next = IS(next_nan) ? NAN : due;
    if (IS(next_past) && m->timed) to->is_next = true, to->next = 0.1;
    to->terminate = IS(ends) && m->counts[0] == 4;
    return OK;
}

static int step(Model *m, double point, double size) {
    double end = point + size, crossing = m->u > 0 ? point + (0.5 - m->x) / m->u : INFINITY;
    if (!m->fmu.events) return reject(m, "events must be handled");
    if (!m->timed && end > 0.45) return reject(m, "a step beyond the next event");
    if (IS(stuck)) end = crossing = point;
    if (m->hits || crossing >= end) crossing = end;
    m->fmu.event = m->x < 0.5 && m->x + m->u * (crossing - point) >= 0.5 - 1e-15;
    m->fmu.returned_early = crossing < end || IS(stuck);
    m->x = m->fmu.event ? 0.5 : m->x + m->u * (crossing - point);
    m->fmu.time = m->fmu.last = crossing;
    if (IS(last_nan)) m->fmu.last = NAN, m->fmu.returned_early = true;
    return OK;
}

const Behaviour behaviour = {
    .size = sizeof(Model), .saved = sizeof(Model), .state = offsetof(Model, x), .start = set_start, .place = place, .step = step,
    .update = update_model, .count = count, .derivatives = derivatives, .indicators = indicators,
};

int fmi3SetClock(void *c, const uint32_t *vr, size_t n, const bool *active) {
    ALLOW(EVENT)
    for (size_t i = 0; i < n; i++) {
        NEED(vr[i] >= TICK && vr[i] < OUT, "not an input clock")
        NEED(active[i] && !m->evaluated, "a clock is activated too late")
        m->active[index_of(vr[i])] = 1;
    }
    return OK;
}

int fmi3GetClock(void *c, const uint32_t *vr, size_t n, bool *active) {
    ALLOW(EVENT)
    for (size_t i = 0; i < n; i++) {
        NEED(vr[i] == OUT || vr[i] == NEXT, "not an output clock")
        evaluate(m);
        active[i] = is_active(m, (int)vr[i]);
    }
    return OK;
}

enum { NOT_YET_KNOWN, UNCHANGED, CHANGED };

int fmi3GetIntervalDecimal(void *c, const uint32_t *vr, size_t n, double *interval, int *qualifier) {
    ALLOW(INITIALIZATION | EVENT)
    NEED(n == 1 && (*vr == TUNED || *vr == CHANGING || *vr == DOWN), "the interval is declared, or a fraction")
    *qualifier = IS(qualifier_seven) ? 7 : CHANGED;
    if (*vr == TUNED) {
        *interval = m->period;
        if (m->known == m->period) *qualifier = UNCHANGED;
        m->known = m->period;
        if (IS(tuned_unknown)) *qualifier = NOT_YET_KNOWN;
        if (IS(tuned_zero)) *interval = 0;
        if (IS(tuned_tiny)) *interval = 1e-15;
    } else if (*vr == CHANGING) {
        *interval = (m->counts[index_of(CHANGING)] + 1) / 10.0;
        if (IS(changing_zero) && m->fmu.time >= 0.3 - 1e-9) *interval = 0;
        if (IS(changing_nan) && m->fmu.time >= 0.3 - 1e-9) *interval = NAN;
        if (IS(changing_negative)) *interval = -0.1;
    } else {
        *interval = 0.25;
        if (!m->is_down) *qualifier = NOT_YET_KNOWN;
        m->is_down = false;
    }
    return OK;
}

int fmi3GetIntervalFraction(void *c, const uint32_t *vr, size_t n, uint64_t *counter, uint64_t *resolution, int *qualifier) {
    ALLOW(INITIALIZATION)
    NEED(n == 1 && *vr == THIRD, "not a fraction")
    *counter = 1, *resolution = IS(resolution_zero) ? 0 : 3, *qualifier = CHANGED;
    return OK;
}

int fmi3GetShiftDecimal(void *c, const uint32_t *vr, size_t n, double *shift) {
    ALLOW(INITIALIZATION)
    NEED(n == 1 && *vr == TUNED, "the shift is declared, or a fraction")
    *shift = IS(shift_negative) ? -1 : 0.2;
    return OK;
}

int fmi3GetShiftFraction(void *c, const uint32_t *vr, size_t n, uint64_t *counter, uint64_t *resolution) {
    ALLOW(INITIALIZATION)
    NEED(n == 1 && *vr == THIRD, "not a fraction")
    *counter = 2, *resolution = 3;
    return OK;
}
