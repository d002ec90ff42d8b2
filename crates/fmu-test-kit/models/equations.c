/* Models with known solutions for Model Exchange, and faulty ones. The guid selects one, as in "{ball}", except the pendulum, which is
   also for Co-Simulation, although it cannot make a step: it is for linearization. */
#include "frame.h"

#define MODELS(M) \
    M(ball)      /* x'' = -9.81 from x = 1; at x <= 0 the speed is reversed and multiplied by p, and the height stays as it is. */ \
    M(zeno)      /* The ball, but its height becomes 0 at a hit. It hits the ground infinitely often before 2.56 s. */ \
    M(stair)     /* hits = number of full seconds; ends the simulation when hits >= p. It has no states. */ \
    M(vanderpol) /* x0' = x1, x1' = p (1 - x0^2) x1 - x0, from (2, 0). */ \
    M(pendulum)  /* x0' = x1, x1' = u - p sin(x0) - x1, y = 1 - cos(x0), from (0.5, 0); its first event takes two updates. */ \
    M(dahlquist) /* x' = -p x, from x = 1. */ \
    M(lag)       /* x' = u + n - p x, from x = 0. */ \
    M(nan)       /* x' = 1, and NaN from t = 0.5 on. */ \
    M(root)      /* x' = -sqrt(x), from x = 1; x < 0 is discarded. */ \
    M(zero)      /* x' = -x, with an event indicator that is always 0. */ \
    M(endless)   /* The event at t = 0.5 requests another iteration after each iteration. */ \
    M(relay)     /* x' = -1 if x > 0, else 1: after 1 s the sign of x changes again and again. */ \
    M(announce)  /* From t = 0.5 on, each event announces another one at the same time. */ \
    M(swap)      /* x' = x, from x = 1. After the first step with |x| > 2 it requests an event, at which x becomes -x and y = -x. */ \
    M(stale)     /* x' = -x; y is calculated only when the derivatives are read: OpenModelica 1.12. */ \
    M(flagged)   /* x' = -x; y is calculated when it is read after the states have been set, unless the derivatives have been read
                    since: OpenModelica 1.21. */ \
    M(wave)      /* hits = number of changes of the sign of cos(10 pi t). It has no states. */ \
    M(pair)      /* x' = 1. At t = 0.5 there are two events: the first one announces the second one for the same time. */ \
    M(nowhere)   /* x' = 1. The event at t = 0.5 announces one at NaN. */ \
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

struct Model {
    Fmu fmu;
    double x[2], u, w, p, y;
    int32_t n, hits;
    int above, sign, wants, updates, due;
    int model;
};

static void set_start(Model *m) {
    int model = 0;
    while (model < COUNT && !is(NAMES[model])) model++;
    m->model = model;
    m->sign = m->due = 1;
    m->above = model == wave_;
    m->p = model == ball_ || model == zeno_ ? 0.7 : model == stair_ ? 10 : model == pendulum_ ? 9 : 1;
    m->x[0] = model == lag_ ? 0 : model == vanderpol_ ? 2 : model == pendulum_ ? 0.5 : 1;
}

static int begin(Model *m, const char *token, const char *resources) {
    (void)token, (void)resources;
    return m->model == COUNT || (m->fmu.cs && m->model != pendulum_) ? ERROR : OK;
}

static int failed(Model *m, int status, const char *why) {
    LOG(&m->fmu, status, "logStatusError", why);
    return status;
}

static size_t count(const Model *m, bool indicators) {
    switch (m->model) {
    case ball_: case zeno_: return indicators ? 1 : 2;
    case vanderpol_: case pendulum_: return indicators ? 0 : 2;
    case stair_: return 0;
    case wave_: return indicators;
    case relay_: case ending_: case zero_: return 1;
    default: return indicators ? 0 : 1;
    }
}

static double wave(const Model *m) { return cos(10 * acos(-1) * m->fmu.time); }

static void indicators(Model *m, double *to) {
    *to = m->model == zero_ ? 0 : m->model == ending_ ? m->x[0] - 0.5 : m->model == wave_ ? wave(m) : m->x[0];
}

static int derivatives(Model *m, double *d) {
    const double *x = m->x;
    switch (m->model) {
    case ball_: case zeno_: d[0] = x[1]; d[1] = -9.81; break;
    case vanderpol_: d[0] = x[1]; d[1] = m->p * (1 - x[0] * x[0]) * x[1] - x[0]; break;
    case pendulum_: d[0] = x[1]; d[1] = m->u - m->p * sin(x[0]) - x[1]; break;
    case dahlquist_: case steady_: d[0] = -m->p * x[0]; break;
    case lag_: d[0] = m->u + m->n - m->p * x[0]; break;
    case nan_: d[0] = m->fmu.time < 0.5 ? 1 : NAN; break;
    case root_:
        if (x[0] < 0) return failed(m, DISCARD, "the root of a negative number");
        d[0] = -sqrt(x[0]);
        break;
    case relay_: d[0] = m->above ? -1 : 1; break;
    case swap_: d[0] = x[0]; break;
    case turn_: d[0] = m->sign; break;
    case stale_: d[0] = -x[0]; m->y = x[0]; break;
    case flagged_: d[0] = -x[0]; m->due = 0; break;
    case pair_: case nowhere_: d[0] = 1; break;
    case failing_:
        if (m->fmu.time >= 0.5) return failed(m, ERROR, "the valve is stuck");
        d[0] = 1;
        break;
    default: d[0] = -x[0];
    }
    return OK;
}

static int update_model(Model *m, Update *to) {
    double time = m->fmu.time;
    switch (m->model) {
    case ball_: case zeno_:
        if (m->x[0] <= 0 && m->x[1] < 0) { m->x[1] *= -m->p; m->hits++; to->states = true; if (m->model == zeno_) m->x[0] = 0; }
        break;
    case stair_:
        m->hits = (int32_t)floor(time + 1e-9);
        to->is_next = true;
        to->next = m->hits + 1;
        to->terminate = m->hits >= m->p;
        break;
    case endless_: to->again = time >= 0.5; to->is_next = time < 0.5; to->next = 0.5; break;
    case announce_: to->is_next = true; to->next = time < 0.5 ? 0.5 : time; break;
    case wave_: m->hits += m->above != (wave(m) > 0); break;
    case pair_:
        if (time >= 0.5 && m->hits < 2) m->hits++;
        to->is_next = m->hits < 2;
        to->next = 0.5;
        break;
    case nowhere_: to->is_next = true; to->next = time < 0.5 ? 0.5 : NAN; break;
    case swap_: if (m->wants) { m->x[0] *= -1; m->sign *= -1; m->hits++; to->states = to->nominals = true; } break;
    case steady_: m->hits += m->wants; break;
    case turn_: if (m->wants) { m->sign = -1; m->hits++; } break;
    case ending_: to->terminate = m->x[0] <= 0.5; break;
    case pendulum_: to->again = m->updates++ == 0; break;
    default: break;
    }
    m->wants = 0;
    m->above = m->model == wave_ ? wave(m) > 0 : m->model == relay_ && m->x[0] > 0;
    return OK;
}

static int completed(Model *m, bool *event) {
    m->wants |= m->model == swap_ && fabs(m->x[0]) > 2 && m->hits == 0;
    m->wants |= m->model == steady_ || (m->model == turn_ && m->x[0] > 1.5 && m->hits == 0);
    *event = m->wants;
    return OK;
}

static int nominals(Model *m, double *to) {
    if (m->model == picky_ && m->p == 2) return ERROR;
    if (m->model == swap_ && m->hits) to[0] = 100;
    return OK;
}

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    double d[2] = {0, 0};
    (void)kind;
    switch (vr) {
    case U: return at_real(to, &m->u, INPUT);
    case W: return at_real(to, &m->w, INPUT);
    case RATE: return at_real(to, &m->w, 0);
    case N: return at(to, INTEGER, &m->n, DISCRETE);
    case P: return at_real(to, &m->p, m->model == pendulum_ ? FIXED : START);
    case Y:
        if (m->model == pendulum_) return calculated(&m->fmu, to, 1 - cos(m->x[0]));
        if (m->model == flagged_ && m->due) { m->y = m->x[0]; m->due = 0; }
        return calculated(&m->fmu, to, m->model == stale_ || m->model == flagged_ ? m->y : (m->model == swap_ ? m->sign : 1) * m->x[0]);
    case HITS: return at(to, INTEGER, &m->hits, 0);
    case X0: case X1: return at_real(to, &m->x[vr - X0], FIXED);
    case D0: case D1: return derivatives(m, d) == OK && calculated(&m->fmu, to, d[vr - D0]);
    default: return false;
    }
}

static bool take(Model *m, uint32_t vr, const void *value) {
    (void)value;
    m->due |= vr == UINT32_MAX;
    return true;
}

static int enters(Model *m, int mode) {
    return mode == CONTINUOUS && m->model == pendulum_ && m->updates < 2 ? failed(m, ERROR, "another update is needed") : OK;
}

static double partial(const Model *m, uint32_t unknown, uint32_t known) {
    const double *x = m->x;
    if (m->model == vanderpol_)
        return unknown == D0 ? known == X1 : known == X0 ? -2 * m->p * x[0] * x[1] - 1 : m->p * (1 - x[0] * x[0]);
    if (m->model != pendulum_ || (!m->fmu.cs && m->updates < 2)) return NAN;
    if (unknown == X1 || unknown == D0) return known == X1;
    if (unknown == D1) return known == X0 ? -m->p * cos(x[0]) : known == X1 ? -1 : known == U;
    return known == X0 ? unknown == Y ? sin(x[0]) : 1 : 0;
}

const Behaviour behaviour = {
    .size = sizeof(Model), .saved = sizeof(Model), .state = offsetof(Model, x), .begin = begin, .start = set_start, .place = place,
    .take = take, .enter = enters, .update = update_model, .completed = completed, .count = count, .derivatives = derivatives,
    .indicators = indicators, .nominals = nominals, .partial = partial,
};
