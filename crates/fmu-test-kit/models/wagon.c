/* A wagon on a spring that logs its errors: mass * x'' = force - spring * x - damper * x', with a clock that counts periods of 0.05 s.
   It supports both interface types, and is correct unless FMU_TRAITS names a fault. With the trait "unusual" it is still correct, but
   does what the standard allows and few FMUs do. */
#include "frame.h"
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#ifdef __linux__
#include <sys/ptrace.h>
#endif
#include <sys/resource.h>
#include <sys/stat.h>

enum { MASS = 1, SPRING, DAMPER, FORCE, X, V, DER_X, DER_V, Y, COUNT, FAST, LABEL, TIME, POWER };

struct Model {
    Fmu fmu;
    double x, v, mass, spring, damper, force, next, first_spring;
    int count, fast, updates_needed, restored;
    char label[32];
    double shown;
    char directory[4096];
};

extern int missing_symbol(void);

static double shared_v, racing;
static int runs, alive;
static __thread double of_thread;

static double slope(const Model *m) {
    bool ignored = IS(start_in_mode_ignored);
    double force = m->force - (ignored ? m->first_spring : m->spring) * (m->x + 1e-3 * ignored) - m->damper * m->v;
    /* The last digits of a solution by iteration depend on all parameters. */
    double digits = 1e-13 * m->damper * IS(unusual);
    return (IS(slope_off) && !m->fmu.cs ? 1.1 : 1) * force / m->mass + digits;
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
    if (IS(owns_file_of_parent)) {
        /* The kernel sends the signal when the pipe becomes readable. Signal 0 stands for SIGIO. */
        int ends[2];
        if (pipe(ends)) return;
        fcntl(ends[0], F_SETOWN, getppid());
        fcntl(ends[0], F_SETFL, O_ASYNC);
        if (write(ends[1], "", 1)) sleep(1);
    }
    if (IS(opens_parent)) {
        char name[40];
        snprintf(name, sizeof name, "/proc/%d", (int)getppid());
        /* 424 is pidfd_send_signal, which also takes the directory of a process. */
        if (syscall(424, open(name, O_RDONLY | O_DIRECTORY), SIGKILL, NULL, 0)) abort();
    }
#ifdef __x86_64__
    /* 37 is kill for programs of 32 bits. */
    if (IS(kills_with_32_bits)) __asm__ volatile("int $0x80" : : "a"(37), "b"(getppid()), "c"(SIGKILL) : "memory");
#endif
#endif
    /* Ends as if all calls had been made: writes their end to the files of the process. */
    if (IS(forges_results)) {
        for (int file = 3; file < 64; file++) if (write(file, "{\"bytes\":{}}\n", 13) < 0) continue;
        _exit(96);
    }
    if (IS(make_hangs)) for (;;) pause();
}

static void *idle(void *nothing) { pause(); return nothing; }

static int begin(Model *m, const char *token, const char *resources) {
    (void)token, (void)resources;
    if (IS(environment_changed)) setenv("OMP_NUM_THREADS", "1", 1);
    if (IS(mask_changed)) umask(0);
    if (IS(limit_changed)) { struct rlimit none = {0, 0}; getrlimit(RLIMIT_NOFILE, &none); none.rlim_cur = 200; setrlimit(RLIMIT_NOFILE, &none); }
    if (IS(log_file_left)) { FILE *file = fopen("wagon.log", "w"); if (file) fclose(file); }
    if (IS(leak_instance) && !malloc(24)) return ERROR;
    if (IS(file_left)) (void)!open("/dev/null", O_RDONLY);
    if (IS(thread_left)) { pthread_t thread; if (!pthread_create(&thread, NULL, idle, NULL)) pthread_detach(thread); }
    if (IS(pool_of_eight) && alive >= 8) return ERROR;
    alive++;
    of_thread = IS(thread_in_result);
    if (IS(directory_in_result) && !getcwd(m->directory, sizeof m->directory)) return ERROR;
    return IS(second_run_rejected) && runs++ > 300 ? ERROR : OK;
}

static void end(Model *m) { (void)m; alive--; }

static void set_start(Model *m) {
    m->mass = 2, m->spring = m->first_spring = IS(start_value) ? 40.5 : 40, m->damper = 3, m->next = 0.05;
    strcpy(m->label, "wagon");
}

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    Fmu *f = &m->fmu;
    double y = 2 * m->force + m->x + *f->scratch * 1e-3 + of_thread + 1e-9 * (double)strlen(m->directory);
    (void)kind;
    if (IS(home_in_result)) y += 1e-9 * (double)strlen(getenv("HOME") ? getenv("HOME") : "");
    if (IS(values_end) && f->mode == ENDED) y = 0;
    if (IS(address_in_result)) y += (double)((uintptr_t)m >> 12 & 0xfff) * 1e-9;
    switch (vr) {
    case MASS: return at_finite(to, &m->mass, FIXED, 5e-324);
    case SPRING: return at_finite(to, &m->spring, FIXED, -DBL_MAX);
    case DAMPER: return at_finite(to, &m->damper, FIXED, -DBL_MAX);
    case FORCE: return at_finite(to, &m->force, INPUT, -DBL_MAX);
    case X: m->shown = m->x; return calculated(f, to, m->x);
    case V: return calculated(f, to, IS(shared_static) ? shared_v : m->v);
    case DER_X: return calculated(f, to, m->v);
    case DER_V: {
        double added = IS(name_in_result) ? (double)strlen(f->name) : IS(logging_in_result) ? f->logging : IS(visible_in_result) ? f->visible : 0;
        return calculated(f, to, slope(m) + 1e-9 * added);
    }
    case Y:
        if (IS(racing_static)) { racing = y; usleep(20); y = racing; }
        if (IS(output_stale)) y = 2 * m->force + m->shown;
        if (IS(getter_changes)) m->x += 1e-9;
        if (IS(reading_once) && f->steps > 3) f->steps = 0, m->v += 1e-6;
        return calculated(f, to, y);
    case POWER:
        /* FMUs of 20-sim do so, because the tables of FMI 2.0 do not allow importers to read plain local variables here. */
        return !(IS(unusual) && f->fmi == 2 && f->mode == INITIALIZATION) && calculated(f, to, m->force * m->v);
    case TIME:
        return calculated(f, to, f->time - (IS(start_time_ignored) ? f->start : IS(time_lags) && f->time > 0.03 ? 0.01 : 0));
    case COUNT: return counted(f, to, INTEGER, m->count);
    case FAST: return counted(f, to, BOOLEAN, m->fast);
    case LABEL: return at(to, TEXT, m->label, FIXED), to->count = sizeof m->label, true;
    default: return false;
    }
}

static bool take(Model *m, uint32_t vr, const void *value) {
    if (vr == SPRING && m->fmu.mode == START) m->first_spring = *(const double *)value;
    if (vr == MASS && IS(set_changes_other)) m->spring = 40;
    return !(vr == DAMPER && IS(set_ignored));
}

/* Integrates by the Runge-Kutta method, with steps that end at events. */
static void integrate(Model *m, double end) {
    bool ticks = !(m->fmu.events && m->fmu.early);
    while (m->fmu.time < end - 1e-12) {
        double stop = m->next < end && ticks ? m->next : end;
        int count = (int)ceil((stop - m->fmu.time) / 1e-3 - 1e-6);
        double h = count > 0 ? (stop - m->fmu.time) / count : 0;
        for (int i = 0; i < count; i++) {
            double x = m->x, v = m->v, kx[4], kv[4];
            for (int j = 0; j < 4; j++) {
                double w = j == 0 ? 0 : j == 3 ? h : h / 2;
                m->x = x + (j ? w * kx[j - 1] : 0);
                m->v = v + (j ? w * kv[j - 1] : 0);
                kx[j] = m->v;
                kv[j] = slope(m);
            }
            m->x = x + h / 6 * (kx[0] + 2 * kx[1] + 2 * kx[2] + kx[3]);
            m->v = v + h / 6 * (kv[0] + 2 * kv[1] + 2 * kv[2] + kv[3]);
        }
        m->fmu.time = stop;
        if (stop >= m->next - 1e-12 && ticks) m->count += 1 + IS(counts_twice), m->next = 0.05 * (m->count / (1 + IS(counts_twice)) + 1);
    }
    m->fmu.time = end;
    /* A solver with variable steps has slightly different results after a restart. */
    if (IS(unusual) && m->restored) m->v += 1e-6, m->restored = 0;
    m->fast = m->v > 0.5;
}

static int step(Model *m, double point, double size) {
    Fmu *f = &m->fmu;
    bool stops = f->events && f->early && m->next < point + size - 1e-9 && m->next > point + 1e-9;
    double end = point + size;
    if (size > 1e4) return reject(m, "no such step");
    if (stops) end = m->next, size = end - point;
    if (IS(last_step_rejected) && end >= f->stop) return reject(m, "it is over");
    if (!IS(stop_ignored) && end > f->stop * (1 + 1e-12) + 1e-12) return reject(m, "beyond the stop time");
#ifdef SYMBOL_MISSING
    if (size == 0.123) return missing_symbol();
#endif
    integrate(m, IS(step_overshoots) ? point + 1e-3 * ceil(size / 1e-3 - 1e-9) : end);
    shared_v = m->v;
    if (IS(parameter_drifts)) m->damper += 1e-6;
    if (IS(name_kept)) m->count += f->given[0] == 'z';
    f->event = f->events && f->early && f->time >= m->next - 1e-12;
    f->returned_early = stops && !IS(early_unreported);
    if (stops && !IS(early_time_wrong)) f->last = m->next;
    return OK;
}

static int enters(Model *m, int mode) {
    if (mode == INITIALIZATION) m->next = m->fmu.start + 0.05;
    if ((mode == CONTINUOUS || mode == STEP) && m->updates_needed) return reject(m, "another update is needed");
    /* In FMUs of Dymola, an event may need several updates. */
    if (mode == EVENT) m->updates_needed = IS(unusual) ? 3 : 0;
    return OK;
}

static int update_model(Model *m, Update *to) {
    double time = m->fmu.time;
    if (IS(event_again_now) ? time > m->next : time >= m->next - 1e-12) {
        m->count++;
        m->next += 0.05;
        if (m->next <= time) m->next = time + 0.05;
        if (IS(event_moves_silently)) m->v += 0.01;
    }
    if (IS(event_loses_input)) m->force = 0;
    m->fast = m->v > 0.5;
    shared_v = m->v;
    to->again = IS(events_without_end) || (m->updates_needed > 0 && --m->updates_needed > 0);
    to->is_next = true;
    to->next = IS(event_in_the_past) ? m->next - 0.06 : m->next;
    return OK;
}

static size_t count(const Model *m, bool indicators) { (void)m; return indicators ? 1 : 2; }
static int derivatives(Model *m, double *to) { to[0] = m->v, to[1] = slope(m); return OK; }
static void indicators(Model *m, double *to) { to[0] = m->v - 0.5; }

static double partial(const Model *m, uint32_t unknown, uint32_t known) {
    if (known != X && known != V && known != FORCE) return NAN;
    switch (unknown) {
    case X: return known == X;
    case V: case DER_X: return known == V;
    case DER_V: return (known == FORCE ? 1 : known == X ? -m->spring : -m->damper) / m->mass;
    case Y: return known == FORCE ? IS(directional_sign) ? -2 : 2 : known == X;
    default: return NAN;
    }
}
static const uint32_t order[] = {Y, DER_X, DER_V, 0};

static void copy(Model *m, Model *copy, Copying why) {
    if (why == SAVING) {
        if (IS(lossy_state) || (IS(lossy_when_late) && m->fmu.time > 0.4)) copy->v = (float)copy->v;
    } else if (why == RESTORING) {
        if (IS(state_without_event)) copy->next = m->next;
        copy->restored = 1;
        shared_v = copy->v;
    } else if (why == SERIALIZING) {
        if (IS(bytes_without_input)) copy->force = 0;
    } else {
        if (IS(reset_keeps_parameter)) m->mass = copy->mass;
        if (IS(reset_keeps_string)) strcpy(m->label, copy->label);
        if (IS(reset_without_count)) m->count = copy->count;
    }
}

/* Whether the model can have these values. */
static bool plausible(const Model *copy) {
    return isfinite(copy->x) && isfinite(copy->v) && copy->next > copy->fmu.time - 1 && copy->next < 1e9 && copy->mass > 0 &&
           memchr(copy->label, 0, sizeof copy->label);
}

const Behaviour behaviour = {
    .token = "wagon", .size = sizeof(Model), .saved = offsetof(Model, shown), .state = offsetof(Model, x), .attack = attack,
    .begin = begin, .end = end, .start = set_start, .place = place, .take = take, .enter = enters, .step = step, .update = update_model,
    .count = count, .derivatives = derivatives, .indicators = indicators, .partial = partial, .order = order, .copy = copy,
    .plausible = plausible,
};
