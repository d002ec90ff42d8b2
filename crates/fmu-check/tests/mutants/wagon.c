/* A wagon on a spring as an FMU of FMI 2.0 or, with -DFMI=3, of FMI 3.0. It is correct, unless the environment variable WAGON_FAULT
   names one of the faults below, or -DSYMBOL_MISSING or -DWITHOUT_NOMINALS selects a fault in linking. With the name "unusual", the
   wagon is still correct, but does what the standard allows and few FMUs do. The headers of FMI are not used, so that the test FMU
   shares nothing with the tested code. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __linux__
#include <sys/ptrace.h>
#endif
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#ifndef FMI
#define FMI 2
#endif

/* Name of the fault. */
static const char *fault = "none";
#define IS(name) (strcmp(fault, #name) == 0)

__attribute__((constructor)) static void choose(void) {
    if (getenv("WAGON_FAULT")) fault = getenv("WAGON_FAULT");
}

#if FMI == 3
#define API(name) fmi3##name
typedef bool Flag;
typedef void (*Logger)(void *, int, const char *, const char *);
#else
#define API(name) fmi2##name
typedef int Flag;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *finished, *environment;
} Callbacks;
typedef struct {
    Flag again, terminate, nominals, values, defined;
    double next;
} Event;
#endif

enum { MASS = 1, SPRING, DAMPER, FORCE, X, V, DER_X, DER_V, Y, COUNT, FAST, LABEL, TIME, POWER };
enum { INSTANTIATED = 1, INITIALIZATION = 2, STEP = 4, EVENT = 8, CONTINUOUS = 16, TERMINATED = 32 };

typedef struct {
    double time, mass, spring, damper, force, x, v, next;
    double first_spring, stop;
    int count, fast, mode, steps, updates_needed, restored;
    char label[32];
} State;

typedef struct {
    State s;
    int cs, logging, early, events;
    Logger log;
    void *environment;
    const char *given;
    char name[64];
    double *scratch, began, shown;
} Model;

extern int missing_symbol(void);

static State shared;
static int runs, alive;
static double racing;

static void start(State *s) {
    double mass = s->mass;
    int count = s->count;
    char label[sizeof s->label];
    memcpy(label, s->label, sizeof label);
    memset(s, 0, sizeof *s);
    s->mass = IS(reset_keeps_parameter) && mass > 0 ? mass : 2;
    s->spring = IS(start_value) ? 40.5 : 40;
    s->damper = 3;
    s->first_spring = s->spring;
    s->next = 0.05;
    s->mode = INSTANTIATED;
    strcpy(s->label, "wagon");
    if (IS(reset_keeps_string) && mass > 0) memcpy(s->label, label, sizeof label);
    s->stop = INFINITY;
    if (IS(reset_without_count)) s->count = count;
}

static int report(Model *m, int status, const char *text) {
    const char *category = IS(category_unknown) ? "unheard of" : "logStatusError";
    if (IS(log_latin1)) text = "rejet\xe9";
    if (!m->log || !m->logging || IS(silent)) return status;
    void *environment = IS(environment_lost) ? (void *)m : m->environment;
#if FMI == 3
    m->log(environment, status, category, text);
#else
    m->log(environment, IS(name_gone) ? m->given : m->name, status, category, text);
#endif
    return status;
}

static int reject(Model *m, const char *text) { return report(m, 3, text); }

#define ALLOW(modes)                                                                  \
    Model *m = c;                                                                     \
    if (!m) return 3;                                                                 \
    if (!(m->s.mode & (modes))) return reject(m, "not allowed here");

static double slope(const Model *m) { return (IS(slope_off) && !m->cs ? 1.1 : 1) * (m->s.force - (IS(start_in_mode_ignored) ? m->s.first_spring : m->s.spring) * (m->s.x + 1e-3 * IS(start_in_mode_ignored)) - m->s.damper * m->s.v) / m->s.mass; }

__attribute__((destructor)) static void unloaded(void) {
    if (IS(unload_crashes)) abort();
    if (IS(exit_hangs)) pause();
}

/* Starts processes and sends signals that the checker must survive. */
static void attack(void) {
    if (IS(forks) && fork() == 0) for (;;) pause();
    if (IS(daemon_left) && fork() == 0) {
        setsid();
        if (fork() == 0) for (;;) pause();
        _exit(0);
    }
    if (IS(forks_without_end)) for (;;) if (fork() == 0) for (setsid();;) pause();
    if (IS(duplicates_itself)) fork();
    if (IS(kills_group)) kill(0, SIGKILL);
    if (IS(kills_parent)) kill(getppid(), SIGKILL);
    /* Signal 0 only tests the permission, so no process is harmed if the checker does not prevent the call. */
    if (IS(kills_all)) kill(-1, 0);
    if (IS(stops_parent)) kill(getppid(), SIGSTOP);
#ifdef __linux__
    if (IS(limits_parent)) {
        char name[4096];
        snprintf(name, sizeof name, "%s/left", getenv("TMPDIR"));
        FILE *file = fopen(name, "w");
        if (file) fclose(file);
        prlimit(getppid(), RLIMIT_NOFILE, &(struct rlimit){1, 1}, NULL);
    }
    if (IS(slows_parent)) setpriority(PRIO_PROCESS, getppid(), 19);
    if (IS(moves_parent)) { cpu_set_t first; CPU_ZERO(&first); CPU_SET(0, &first); sched_setaffinity(getppid(), sizeof first, &first); }
    if (IS(traces_parent)) ptrace(PTRACE_ATTACH, getppid(), NULL, NULL);
#endif
    if (IS(make_hangs)) for (;;) pause();
}

static void *idle(void *nothing) { pause(); return nothing; }

static void *make(const char *name, const char *token, int cs, int logging, Logger log, void *environment) {
    Model *m = calloc(1, sizeof *m);
    attack();
    start(&m->s);
    m->cs = cs; m->log = log; m->logging = logging; m->environment = environment;
    snprintf(m->name, sizeof m->name, "%s", name ? name : "");
    m->given = name;
    if (!name || !*name || !token || (strcmp(token, "wagon") && !IS(token_ignored))) {
        m->logging = 1;
        reject(m, "no name or another token");
        free(m);
        return NULL;
    }
    m->scratch = malloc(sizeof *m->scratch);
    if (!IS(unwritten_memory)) *m->scratch = 0;
    if (IS(environment_changed)) setenv("OMP_NUM_THREADS", "1", 1);
    if (IS(mask_changed)) umask(0);
    if (IS(limit_changed)) { struct rlimit none = {0, 0}; getrlimit(RLIMIT_NOFILE, &none); none.rlim_cur = 200; setrlimit(RLIMIT_NOFILE, &none); }
    if (IS(log_file_left)) { FILE *file = fopen("wagon.log", "w"); if (file) fclose(file); }
    if (IS(leak_instance) && !malloc(24)) return NULL;
    if (IS(file_left)) (void)!open("/dev/null", O_RDONLY);
    if (IS(thread_left)) { pthread_t thread; if (!pthread_create(&thread, NULL, idle, NULL)) pthread_detach(thread); }
    if (IS(pool_of_eight) && ++alive > 8) { free(m->scratch); free(m); m = NULL; alive--; }
    if (!m) return NULL;
    if (IS(second_run_rejected) && runs++ > 300) { free(m->scratch); free(m); return NULL; }
    return m;
}

/* Returns the value of a real variable; sets `known` to whether there is such a variable. */
static double get(Model *m, uint32_t vr, bool *known) {
    const State *s = &m->s;
    double y = 2 * s->force + s->x + *m->scratch * 1e-3;
    if (IS(address_in_result)) y += (double)((uintptr_t)m >> 12 & 0xfff) * 1e-9;
    *known = true;
    switch (vr) {
    case MASS: return IS(early_read_wrong) && s->mode == INSTANTIATED ? 0 : s->mass;
    case SPRING: return s->spring;
    case DAMPER: return s->damper;
    case FORCE: return s->force;
    case X: m->shown = s->x; return s->x;
    case V: return IS(shared_static) ? shared.v : s->v;
    case DER_X: return s->v;
    case DER_V: return slope(m) + (IS(name_in_result) ? 1e-9 * (double)strlen(m->name) : 0);
    case Y:
        if (IS(racing_static)) { racing = y; usleep(20); y = racing; }
        if (IS(output_stale)) return 2 * s->force + m->shown;
        if (IS(getter_changes)) m->s.x += 1e-9;
        if (IS(reading_once) && m->s.steps > 3) m->s.steps = 0, m->s.v += 1e-6;
        return y;
    case POWER: return s->force * s->v;
    case TIME: if (IS(start_time_ignored)) return s->time - m->began; return IS(time_lags) && s->time > 0.03 ? s->time - 0.01 : s->time;
    default: *known = false; return 0;
    }
}

static int settable(const Model *m, uint32_t vr) {
    (void)m;
    return vr >= MASS && vr <= FORCE;
}

static int get_reals(void *c, const uint32_t *vr, size_t n, double *value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | TERMINATED)
    size_t i;
    bool known;
    if (IS(get_after_end_rejected) && m->s.mode == TERMINATED) return reject(m, "it is over");
    if (n && (!vr || !value) && !IS(null_crashes)) return reject(m, "an array is NULL");
    if (IS(crash_amid) && m->s.steps == 7) abort();
    for (i = 0; i < n; i++) {
        get(m, vr[i], &known);
        if (IS(reference_crashes) && !known) *(volatile int *)8 = 0;
        if (IS(reference_exits) && !known) exit(3);
        /* FMUs of 20-sim do so, because the tables of FMI 2.0 do not allow importers to read plain local variables here. */
        if (IS(unusual) && FMI == 2 && vr[i] == POWER && m->s.mode == INITIALIZATION) return reject(m, "a local variable");
        if (!known) return reject(m, "an unknown reference");
    }
    for (i = 0; i < n; i++) if (!(IS(reference_once) && i && vr[i] == vr[i - 1])) value[i] = get(m, vr[i], &known);
    if (IS(write_const) && n) *(uint32_t *)vr = 0;
    if (IS(write_past)) value[n] = 0;
    if (IS(write_before)) value[-1] = 0;
    return IS(status_unknown) && m->s.steps == 2 ? 17 : 0;
}

static int set_reals(void *c, const uint32_t *vr, size_t n, const double *value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | (IS(set_after_end) || IS(set_after_end_crashes) ? TERMINATED : 0))
    size_t i;
    if (IS(set_after_end_crashes) && m->s.mode == TERMINATED) abort();
    if (n && (!vr || !value)) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++) {
        if (IS(half_set) && vr[i] == FORCE) m->s.force = value[i];
        if (!settable(m, vr[i])) return reject(m, "it cannot be set");
        if (vr[i] != FORCE && !(m->s.mode & (INSTANTIATED | INITIALIZATION))) return reject(m, "a fixed parameter");
        if (!isfinite(value[i]) || (vr[i] == MASS && value[i] <= 0)) {
            if (IS(discard_changes)) { m->s.x += 1; return report(m, 2, "no such value"); }
            return reject(m, "no such value");
        }
    }
    if (IS(read_past) && n && value[n] == 1e99) return 3;
    for (i = 0; i < n; i++) switch (vr[i]) {
        case MASS: m->s.mass = value[i]; break;
        case SPRING: m->s.spring = value[i]; if (m->s.mode == INSTANTIATED) m->s.first_spring = value[i]; break;
        case DAMPER: if (!IS(set_ignored)) m->s.damper = value[i]; break;
        default: m->s.force = value[i]; break;
    }
    return 0;
}

static int get_count(void *c, const uint32_t *vr, size_t n, int32_t *value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | TERMINATED)
    size_t i;
    if (n && (!vr || !value)) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++) if (vr[i] != COUNT) return reject(m, "an unknown reference");
    for (i = 0; i < n; i++) if (!IS(output_unwritten)) value[i] = m->s.count + (IS(integer_out_of_range) ? 999 : 0);
    return 0;
}

static int get_fast(void *c, const uint32_t *vr, size_t n, Flag *value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | TERMINATED)
    size_t i;
    if (n && (!vr || !value)) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++) if (vr[i] != FAST) return reject(m, "an unknown reference");
    for (i = 0; i < n; i++) {
        unsigned char two = IS(boolean_two) ? 2 : (unsigned char)(m->s.fast != 0);
        memset(&value[i], 0, sizeof value[i]);
        memcpy(&value[i], &two, 1);
    }
    return 0;
}

static int get_label(void *c, const uint32_t *vr, size_t n, const char **value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT | CONTINUOUS | TERMINATED)
    size_t i;
    if (n && (!vr || !value)) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++) if (vr[i] != LABEL) return reject(m, "an unknown reference");
    for (i = 0; i < n; i++) value[i] = IS(string_latin1) ? "wag\xf6n" : m->s.label;
    return 0;
}

static int set_label(void *c, const uint32_t *vr, size_t n, const char *const *value) {
    ALLOW(INSTANTIATED | INITIALIZATION)
    size_t i;
    if (n && (!vr || !value)) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++)
        if (vr[i] != LABEL || !value[i] || strlen(value[i]) >= sizeof m->s.label) return reject(m, "no such text");
    for (i = 0; i < n; i++) strcpy(m->s.label, value[i]);
    if (IS(string_cut)) m->s.label[8] = 0;
    if (IS(string_leaks) && !malloc(40)) return 3;
    return 0;
}

static int set_none(void *c, const uint32_t *vr, size_t n, const void *value) {
    ALLOW(INSTANTIATED | INITIALIZATION | STEP | EVENT)
    (void)vr; (void)value;
    return n ? reject(m, "it cannot be set") : 0;
}

/* Integrates by the Runge-Kutta method, with steps that end at events. */
static void integrate(Model *m, double end) {
    State *s = &m->s;
    while (s->time < end - 1e-12) {
        double stop = s->next < end && !(m->events && m->early) ? s->next : end;
        int count = (int)ceil((stop - s->time) / 1e-3 - 1e-6), i;
        double h = count > 0 ? (stop - s->time) / count : 0;
        for (i = 0; i < count; i++) {
            double x = s->x, v = s->v, kx[4], kv[4];
            int j;
            for (j = 0; j < 4; j++) {
                double w = j == 0 ? 0 : j == 3 ? h : h / 2;
                s->x = x + (j ? w * kx[j - 1] : 0);
                s->v = v + (j ? w * kv[j - 1] : 0);
                kx[j] = s->v;
                kv[j] = slope(m);
            }
            s->x = x + h / 6 * (kx[0] + 2 * kx[1] + 2 * kx[2] + kx[3]);
            s->v = v + h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]);
        }
        s->time = stop;
        if (s->time >= s->next - 1e-12 && !(m->events && m->early)) { s->count += 1 + IS(counts_twice); s->next = 0.05 * (s->count / (1 + IS(counts_twice)) + 1); }
    }
    s->time = end;
    /* A solver with variable steps has slightly different results after a restart. */
    if (IS(unusual) && s->restored) s->v += 1e-6, s->restored = 0;
    s->fast = s->v > 0.5;
}

static int step(void *c, double point, double size) {
    ALLOW(STEP)
    if (IS(endless_step) && !(size < 1e9)) for (;;) usleep(1000);
    if (IS(long_step_hangs) && size > 1e3 && size < 1e4) for (;;) usleep(1000);
    if (IS(step_rejected_halfway) && !(size > 0)) m->s.x += 0.01;
    if (!isfinite(point) || !isfinite(size) || !(size > 0) || size > 1e4) return reject(m, "no such step");
    if (fabs(point - m->s.time) > 1e-9 * (1 + fabs(point))) return reject(m, "another time");
    if (IS(last_step_rejected) && point + size >= m->s.stop) return reject(m, "it is over");
    if (!IS(stop_ignored) && point + size > m->s.stop * (1 + 1e-12) + 1e-12) return reject(m, "beyond the stop time");
    if (IS(step_prints)) puts("a step");
#ifdef SYMBOL_MISSING
    if (size == 0.123) return missing_symbol();
#endif
    if (IS(step_adds)) m->s.x += 1e-7;
    integrate(m, IS(step_overshoots) ? point + 1e-3 * ceil(size / 1e-3 - 1e-9) : point + size);
    m->s.steps++;
    shared = m->s;
    if (IS(parameter_drifts)) m->s.damper += 1e-6;
    if (IS(leak_step) && !malloc(40)) return 3;
    if (IS(rounding_changed)) __asm__ volatile("ldmxcsr %0" : : "m"((unsigned){0x9fc0}));
    if (IS(locale_changed)) setlocale(LC_ALL, "C.UTF-8");
    if (IS(name_kept)) m->s.count += m->given[0] == 'z';
    if (IS(log_when_off) && m->log) {
#if FMI == 3
        m->log(m->environment, 0, "logStatusError", "a step");
#else
        m->log(m->environment, m->name, 0, "logStatusError", "a step");
#endif
    }
    return 0;
}

static int enter(void *c, double from, double stop) {
    ALLOW(INSTANTIATED)
    if (!isfinite(from) || fabs(from) > 1e9) return reject(m, "no such time");
    m->s.time = from;
    m->s.next = from + 0.05;
    m->s.stop = stop;
    m->began = from;
    m->s.mode = INITIALIZATION;
    return 0;
}

static int update(Model *m, Flag *again, double *next) {
    if (IS(event_again_now) ? m->s.time > m->s.next : m->s.time >= m->s.next - 1e-12) {
        m->s.count++;
        m->s.next += 0.05;
        if (m->s.next <= m->s.time) m->s.next = m->s.time + 0.05;
        if (IS(event_moves_silently)) m->s.v += 0.01;
    }
    if (IS(event_loses_input)) m->s.force = 0;
    m->s.fast = m->s.v > 0.5;
    shared = m->s;
    *again = IS(events_without_end) || (m->s.updates_needed > 0 && --m->s.updates_needed > 0);
    *next = IS(event_in_the_past) ? m->s.next - 0.06 : m->s.next;
    return 0;
}

#if FMI == 3
#define EXPORT(name) int fmi3##name
const char *fmi3GetVersion(void) { return IS(version_wrong) ? "2.0" : "3.0"; }

void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                   void *environment, Logger log) {
    (void)resources; (void)visible;
    return make(name, token, 0, logging, log, environment);
}
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool event_mode, bool early, const uint32_t *vr, size_t n, void *environment, Logger log,
                                  void *intermediate) {
    Model *m = make(name, token, 1, logging, log, environment);
    (void)resources; (void)visible; (void)vr; (void)n; (void)intermediate;
    if (m) { m->early = early; m->events = event_mode; }
    return m;
}
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
#define FREE fmi3FreeInstance
#define STATE(verb, end) int fmi3##verb##FMUState##end
#define DESERIALIZE int fmi3DeserializeFMUState
#define SIZES , size_t nvalues
#define SIZES_RIGHT if (c && nvalues != n) return reject(c, "sizes that differ");
#else
#define EXPORT(name) int fmi2##name
const char *fmi2GetVersion(void) { return IS(version_wrong) ? "2.1" : "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources, const Callbacks *callbacks,
                      int visible, int logging) {
    (void)resources; (void)visible;
    return callbacks ? make(name, token, type == 1, logging, callbacks->logger, callbacks->environment) : NULL;
}
#define FREE fmi2FreeInstance
#define STATE(verb, end) int fmi2##verb##FMUstate##end
#define DESERIALIZE int fmi2DeSerializeFMUstate
#define SIZES
#define SIZES_RIGHT
#endif
typedef const char *Text;
#define ACCESS(name, type, get, set)                                                                                          \
    EXPORT(Get##name)(void *c, const uint32_t *vr, size_t n, type *value SIZES) { SIZES_RIGHT return get(c, vr, n, value); } \
    EXPORT(Set##name)(void *c, const uint32_t *vr, size_t n, const type *value SIZES) { SIZES_RIGHT return set(c, vr, n, value); }
#define REJECTED(name) EXPORT(name)(void *c) { return c ? reject(c, "not supported") : 3; }

void FREE(void *c) {
    Model *m = c;
    if (IS(free_null_crashes)) *(volatile char *)m = *(volatile char *)m;
    if (m) free(m->scratch);
    if (m) alive--;
    free(m);
}

EXPORT(SetDebugLogging)(void *c, Flag on, size_t n, const char *const *categories) {
    ALLOW(63)
    size_t i;
    if (n && !categories) return reject(m, "an array is NULL");
    for (i = 0; i < n; i++) if (!categories[i] || strcmp(categories[i], "logStatusError")) return reject(m, "an unknown category");
    m->logging = on;
    return 0;
}

EXPORT(ExitInitializationMode)(void *c) {
    ALLOW(INITIALIZATION)
    m->s.mode = m->cs && !m->events ? STEP : EVENT;
    /* In FMUs of Dymola, an event may need several updates. */
    m->s.updates_needed = IS(unusual) && m->s.mode == EVENT ? 3 : 0;
    return 0;
}
EXPORT(Terminate)(void *c) {
    ALLOW(STEP | EVENT | CONTINUOUS)
    if (IS(name_gone)) report(m, 0, "the end");
    if (IS(terminate_rejected) && m->s.steps > 1) return reject(m, "not yet");
    m->s.mode = TERMINATED;
    return 0;
}
EXPORT(Reset)(void *c) {
    ALLOW(63)
    if (IS(reset_rejected) && m->s.mode == TERMINATED) return reject(m, "it is over");
    start(&m->s);
    return 0;
}
EXPORT(EnterEventMode)(void *c) {
    ALLOW(CONTINUOUS | EVENT | STEP)
    if (m->s.mode == STEP && !m->events) return reject(m, "no event mode was agreed upon");
    m->s.mode = EVENT;
    m->s.updates_needed = IS(unusual) ? 3 : 0;
    return 0;
}
EXPORT(EnterContinuousTimeMode)(void *c) { ALLOW(EVENT) if (m->s.updates_needed) return reject(m, "another update is needed"); m->s.mode = CONTINUOUS; return 0; }
EXPORT(CompletedIntegratorStep)(void *c, Flag no_set, Flag *event, Flag *terminate) {
    ALLOW(CONTINUOUS)
    (void)no_set;
    if (!event || !terminate) return reject(m, "a flag is NULL");
    m->s.steps++;
    *event = 0; *terminate = 0;
    return 0;
}
EXPORT(SetTime)(void *c, double time) {
    ALLOW(CONTINUOUS)
    if (!isfinite(time)) return reject(m, "no such time");
    m->s.time = time;
    return 0;
}
EXPORT(SetContinuousStates)(void *c, const double *x, size_t n) {
    ALLOW(CONTINUOUS)
    if (n != 2 || !x || !isfinite(x[0]) || !isfinite(x[1])) return reject(m, "no such states");
    m->s.x = x[0]; m->s.v = x[1];
    shared = m->s;
    return 0;
}
EXPORT(GetContinuousStates)(void *c, double *x, size_t n) {
    ALLOW(62)
    if (n != 2 || !x) return reject(m, "there are two states");
    x[0] = m->s.x; x[1] = m->s.v;
    return 0;
}
#if FMI == 3
EXPORT(GetContinuousStateDerivatives)(void *c, double *x, size_t n) {
#else
EXPORT(GetDerivatives)(void *c, double *x, size_t n) {
#endif
    ALLOW(62)
    if (n != 2 || !x) return reject(m, "there are two states");
    x[IS(vector_swapped)] = m->s.v; x[!IS(vector_swapped)] = slope(m);
    return 0;
}
EXPORT(GetEventIndicators)(void *c, double *z, size_t n) {
    ALLOW(62)
    if (n != 1 || !z) return reject(m, "there is one event indicator");
    z[0] = m->s.v - 0.5;
    return 0;
}
#ifndef WITHOUT_NOMINALS
EXPORT(GetNominalsOfContinuousStates)(void *c, double *x, size_t n) {
    ALLOW(63)
    if (n != 2 || !x) return reject(m, "there are two states");
    x[0] = IS(nominal_zero) ? 0 : 1; x[1] = 1;
    return 0;
}
#endif

/* Copies of states to which serialized states point with the fault bytes_with_address. */
static char *secret[4096];
static unsigned secrets;

STATE(Get, )(void *c, void **state) {
    ALLOW(63)
    State *saved;
    if (!state) return reject(m, "a handle is NULL");
    if (IS(state_not_supported)) return reject(m, "not supported");
    saved = *state ? *state : malloc(sizeof *saved);
    if (!(IS(handle_not_reused) && *state)) *saved = m->s;
    if (IS(lossy_state) || (IS(lossy_when_late) && m->s.time > 0.4)) saved->v = (float)saved->v;
    if (IS(state_without_event)) saved->next = -1;
    if (IS(save_changes)) m->s.x += 1e-6;
    if (IS(leak_state) && !malloc(16)) return 3;
    *state = saved;
    return 0;
}
STATE(Set, )(void *c, void *state) {
    ALLOW(63)
    double next = m->s.next;
    if (!state) return reject(m, "a state is NULL");
    m->s = *(State *)state;
    if (IS(state_without_event)) m->s.next = next;
    m->s.restored = 1;
    if (IS(restore_consumes)) ((State *)state)->x = 0;
    shared = m->s;
    return 0;
}
STATE(Free, )(void *c, void **state) {
    ALLOW(63)
    if (!state) return 0;
    free(*state);
    if (!IS(freed_handle_stays)) *state = NULL;
    return 0;
}
STATE(Serialized, Size)(void *c, void *state, size_t *size) {
    ALLOW(63)
    if (!state || !size) return reject(m, "NULL");
    *size = sizeof(State) + 8;
    return 0;
}
STATE(Serialize, )(void *c, void *state, char *bytes, size_t size) {
    ALLOW(63)
    State copy;
    if (!state || !bytes || size < sizeof copy + 8) return reject(m, "no room");
    copy = *(State *)state;
    if (IS(bytes_without_input)) copy.force = 0;
    memset(bytes, 0, size);
    memcpy(bytes, "wagon001", 8);
    if (IS(bytes_with_address)) {
        unsigned number = secrets++ % 4096;
        secret[number] = malloc(sizeof copy);
        memcpy(secret[number], &copy, sizeof copy);
        memcpy(bytes + 8, &secret[number], sizeof(char *));
    } else memcpy(bytes + 8, &copy, sizeof copy);
    return 0;
}
DESERIALIZE(void *c, const char *bytes, size_t size, void **state) {
    ALLOW(63)
    State copy;
    if (!state || !bytes || (size != sizeof copy + 8 && !IS(bytes_crash))) return reject(m, "no state");
    if (IS(bytes_crash)) { memcpy(&copy, bytes + 8, sizeof copy); }
    if (memcmp(bytes, "wagon001", 8)) return reject(m, "no state");
    if (IS(bytes_with_address)) { char *from; memcpy(&from, bytes + 8, sizeof from); memcpy(&copy, from, sizeof copy); }
    else memcpy(&copy, bytes + 8, sizeof copy);
    /* Values that the model cannot have are rejected. */
    copy.label[sizeof copy.label - 1] = 0;
    if (!isfinite(copy.time) || !isfinite(copy.x) || !isfinite(copy.v) || !(copy.next > copy.time - 1) || !(copy.next < 1e9) ||
        !(copy.mass > 0) || !(fabs(copy.time) < 1e9)) return reject(m, "no state");
    if (!*state) *state = malloc(sizeof copy);
    memcpy(*state, &copy, sizeof copy);
    return 0;
}

/* d(unknown)/d(known). */
static double partial(const Model *m, uint32_t unknown, uint32_t known) {
    const State *s = &m->s;
    switch (unknown) {
    case X: return known == X;
    case V: case DER_X: return known == V;
    case DER_V: return (known == FORCE ? 1 : known == X ? -s->spring : known == V ? -s->damper : 0) / s->mass;
    case Y: return known == FORCE ? IS(directional_sign) ? -2 : 2 : known == X;
    default: return NAN;
    }
}
static int directional(void *c, const uint32_t *unknown, size_t nu, const uint32_t *known, size_t nk, const double *seed,
                       double *out, bool adjoint) {
    ALLOW(62)
    size_t i, j;
    double *sums;
    if ((nu && !unknown) || (nk && !known) || ((adjoint ? nu : nk) && !seed) || ((adjoint ? nk : nu) && !out)) return reject(m, "NULL");
    for (i = 0; i < nu; i++) if (isnan(partial(m, unknown[i], X))) return reject(m, "an unknown that is none");
    for (j = 0; j < nk; j++) if (known[j] != X && known[j] != V && known[j] != FORCE) return reject(m, "a known that is none");
    sums = calloc(nu + nk + 1, sizeof *sums);
    uint32_t own[8];
    if (IS(order_ignored) && nu <= 8 && !adjoint) {
        /* Sorts the unknowns as in ModelStructure, as if their order in the call did not matter. */
        static const uint32_t order[] = { Y, DER_X, DER_V };
        size_t next = 0, k;
        for (k = 0; k < 3; k++) for (i = 0; i < nu; i++) if (unknown[i] == order[k]) own[next++] = unknown[i];
        if (next == nu) unknown = own;
    }
    for (i = 0; i < nu; i++)
        for (j = 0; j < nk; j++) {
            double d = partial(m, unknown[i], known[j]);
            if (adjoint && IS(adjoint_off)) d *= 1 + 1e-9;
            if (IS(directional_imprecise)) d *= 1 + 1e-6;
            sums[adjoint ? j : i] += d * seed[adjoint ? i : j];
        }
    if (IS(directional_not_linear) && nk > 1 && seed[0] != 0 && seed[1] != 0) sums[0] += 1;
    for (i = 0; i < (adjoint ? nk : nu); i++) out[i] = sums[i] + (IS(directional_added) ? out[i] : 0);
    free(sums);
    if (IS(derivative_changes)) m->s.x += 1e-8;
    return 0;
}

#if FMI == 3
EXPORT(EnterInitializationMode)(void *c, bool defined, double tolerance, double from, bool stops, double stop) {
    (void)defined; (void)tolerance;
    return enter(c, from, stops ? stop : INFINITY);
}
#define NONE(type)                                                                                                                   \
    EXPORT(Get##type)(void *c, const uint32_t *vr, size_t n, void *value, size_t nvalues) { ALLOW(63) (void)vr; (void)value; (void)nvalues; return n ? reject(m, "there are none") : 0; } \
    EXPORT(Set##type)(void *c, const uint32_t *vr, size_t n, const void *value, size_t nvalues) { (void)nvalues; return set_none(c, vr, n, value); }
ACCESS(Float64, double, get_reals, set_reals) ACCESS(Int32, int32_t, get_count, set_none)
ACCESS(Boolean, bool, get_fast, set_none) ACCESS(String, Text, get_label, set_label)
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(UInt32) NONE(Int64) NONE(UInt64)
EXPORT(UpdateDiscreteStates)(void *c, bool *again, bool *terminate, bool *nominals, bool *values, bool *defined, double *next) {
    ALLOW(EVENT)
    if (!again || !terminate || !nominals || !values || !defined || !next) return reject(m, "a flag is NULL");
    *terminate = *nominals = *values = false;
    *defined = true;
    return update(m, again, next);
}
EXPORT(DoStep)(void *c, double point, double size, bool no_set, bool *event, bool *terminate, bool *early, double *last) {
    int status;
    (void)no_set;
    if (c && (!event || !terminate || !early || !last)) return reject(c, "a flag is NULL");
    Model *m = c;
    bool stops = m && m->events && m->early && m->s.next < point + size - 1e-9 && m->s.next > point + 1e-9;
    status = step(c, point, stops ? m->s.next - point : size);
    if (status) return status;
    *event = m->events && m->early && m->s.time >= m->s.next - 1e-12;
    *terminate = false;
    *early = stops && !IS(early_unreported);
    *last = IS(last_time_wrong) ? point : stops && !IS(early_time_wrong) ? m->s.next : point + size;
    return 0;
}
EXPORT(GetDirectionalDerivative)(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns, double *out, size_t no_) {
    if (c && (ns != nk || no_ != nu)) return reject(c, "sizes that differ");
    return directional(c, u, nu, k, nk, seed, out, false);
}
EXPORT(GetAdjointDerivative)(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns, double *out, size_t no_) {
    if (c && (ns != nu || no_ != nk)) return reject(c, "sizes that differ");
    return directional(c, u, nu, k, nk, seed, out, true);
}
EXPORT(GetNumberOfContinuousStates)(void *c, size_t *n) { ALLOW(63) if (!n) return reject(m, "NULL"); *n = 2; return 0; }
EXPORT(GetNumberOfEventIndicators)(void *c, size_t *n) { ALLOW(63) if (!n) return reject(m, "NULL"); *n = 1; return 0; }
EXPORT(EnterStepMode)(void *c) { ALLOW(EVENT) if (!m->cs || m->s.updates_needed) return reject(m, "not in Model Exchange, nor before the last update"); m->s.mode = STEP; return 0; }
REJECTED(GetBinary) REJECTED(SetBinary) REJECTED(GetClock) REJECTED(SetClock) REJECTED(GetNumberOfVariableDependencies)
REJECTED(GetVariableDependencies) REJECTED(EnterConfigurationMode) REJECTED(ExitConfigurationMode) REJECTED(GetIntervalDecimal)
REJECTED(GetIntervalFraction) REJECTED(GetShiftDecimal) REJECTED(GetShiftFraction) REJECTED(SetIntervalDecimal)
REJECTED(SetIntervalFraction) REJECTED(SetShiftDecimal) REJECTED(SetShiftFraction) REJECTED(EvaluateDiscreteStates)
REJECTED(GetOutputDerivatives) REJECTED(ActivateModelPartition)
#else
EXPORT(SetupExperiment)(void *c, int defined, double tolerance, double from, int stops, double stop) {
    ALLOW(INSTANTIATED)
    (void)defined; (void)tolerance;
    if (!isfinite(from) || fabs(from) > 1e9) return reject(m, "no such time");
    m->s.time = from;
    m->s.stop = stops ? stop : INFINITY;
    return 0;
}
EXPORT(EnterInitializationMode)(void *c) { return enter(c, c ? ((Model *)c)->s.time : 0, c ? ((Model *)c)->s.stop : 0); }
ACCESS(Real, double, get_reals, set_reals) ACCESS(Integer, int32_t, get_count, set_none)
ACCESS(Boolean, int, get_fast, set_none) ACCESS(String, Text, get_label, set_label)
EXPORT(NewDiscreteStates)(void *c, Event *event) {
    ALLOW(EVENT)
    if (!event) return reject(m, "NULL");
    memset(event, 0, sizeof *event);
    event->defined = 1;
    return update(m, &event->again, &event->next);
}
EXPORT(DoStep)(void *c, double point, double size, int no_set) { (void)no_set; return step(c, point, size); }
EXPORT(CancelStep)(void *c) { return c ? reject(c, "no step is under way") : 3; }
EXPORT(GetDirectionalDerivative)(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, double *out) {
    return directional(c, u, nu, k, nk, seed, out, false);
}
REJECTED(SetRealInputDerivatives) REJECTED(GetRealOutputDerivatives) REJECTED(GetStatus) REJECTED(GetRealStatus)
REJECTED(GetIntegerStatus) REJECTED(GetBooleanStatus) REJECTED(GetStringStatus)
#endif
