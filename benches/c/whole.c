/* Times whole steps through the C interface, of several libraries in turn, in one run.
 *   whole GUID FMU.so BARE.so EULER.so GENERATED.so
 *   whole GUID LIBRARY.so WAY STEPS        one of the ways to step alone, for a profiler
 * Each figure is the smallest of several rounds over all of them, so that a machine whose speed drifts
 * treats them alike; those of the C sources are medians of many short ones. Prints Markdown tables. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <malloc.h>
#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef void *Component;
typedef void (*Logger)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    Logger logger;
    void *allocate, *release, *finished, *environment;
} Callbacks;

typedef struct {
    const char *name;
    Component (*instantiate)(const char *, int, const char *, const char *, const Callbacks *, int, int);
    void (*release)(Component);
    int (*setup)(Component, int, double, double, int, double);
    int (*enter)(Component), (*leave)(Component);
    int (*set)(Component, const unsigned *, size_t, const double *);
    int (*get)(Component, const unsigned *, size_t, double *);
    int (*set_boolean)(Component, const unsigned *, size_t, const int *);
    int (*set_rates)(Component, const unsigned *, size_t, const int *, const double *);
    int (*step)(Component, double, double, int);
    int (*get_state)(Component, void **), (*set_state)(Component, void *), (*free_state)(Component, void **);
    int (*derivative)(Component, const unsigned *, size_t, const unsigned *, size_t, const double *, double *);
} Library;

static const char *guid;

static void fail(const char *what) {
    fprintf(stderr, "bench: %s\n", what);
    exit(1);
}
static void logger(void *e, const char *n, int s, const char *c, const char *m, ...) {
    (void)e, (void)n, (void)s, (void)c;
    fprintf(stderr, "%s\n", m);
}
static const Callbacks CALLBACKS = {logger, 0, 0, 0, 0};

static Library load(const char *name, const char *path) {
    void *l = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!l) fail(dlerror());
    return (Library){name, dlsym(l, "fmi2Instantiate"), dlsym(l, "fmi2FreeInstance"), dlsym(l, "fmi2SetupExperiment"),
                     dlsym(l, "fmi2EnterInitializationMode"), dlsym(l, "fmi2ExitInitializationMode"),
                     dlsym(l, "fmi2SetReal"), dlsym(l, "fmi2GetReal"), dlsym(l, "fmi2SetBoolean"),
                     dlsym(l, "fmi2SetRealInputDerivatives"), dlsym(l, "fmi2DoStep"), dlsym(l, "fmi2GetFMUstate"),
                     dlsym(l, "fmi2SetFMUstate"), dlsym(l, "fmi2FreeFMUstate"),
                     dlsym(l, "fmi2GetDirectionalDerivative")};
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static const unsigned INPUTS[4] = {0, 1, 2, 3}, OUTPUTS[4] = {4, 5, 6, 7}, USE_OMEGA = 33;
static const int ORDERS[2] = {1, 1};

static Component start(const Library *l, int use_omega) {
    Component c = l->instantiate("bench", 1, guid, "", &CALLBACKS, 0, 0);
    if (!c) fail("fmi2Instantiate gave NULL");
    l->set_boolean(c, &USE_OMEGA, 1, &use_omega);
    l->setup(c, 0, 0, 0, 0, 0);
    l->enter(c);
    l->leave(c);
    return c;
}

/* The inputs of step k, from a table: their calculation is no part of what is timed. */
enum { PERIOD = 200 };
static double motion[PERIOD][4];
/* Writes the inputs one by one right before they are set, as a master does. A library that reads two at once has to wait
 * until both have left the processor. */
static inline void write_inputs(double *inputs, const double *u, int rates) {
    inputs[0] = u[0];
    __asm__ volatile("" ::: "memory"); /* not two at once */
    inputs[1] = u[1];
    if (!rates) return;
    inputs[2] = u[2];
    __asm__ volatile("" ::: "memory");
    inputs[3] = u[3];
}

static void make_motion(void) {
    const double pi = 3.14159265358979323846;
    for (int k = 0; k < PERIOD; k++) {
        double t = 1e-3 * k, angle = (1 - cos(10 * pi * t)) / (10 * pi), rate = sin(10 * pi * t);
        motion[k][0] = angle, motion[k][1] = -angle, motion[k][2] = rate, motion[k][3] = -rate;
    }
}

typedef enum { VECTORS, SCALARS, RATES, OMEGA, ALTERNATING, NEW_SIZES, STATES, DERIVATIVES, WAYS_COUNT } Way;
static const char *WAYS[] = {
    "angles set, step, 4 outputs, as vectors", "the same, one scalar a call",  "with input derivatives",
    "with use_omega and rates set",            "step size alternating among 4", "a new step size every step",
    "fmi2GetFMUstate and Set every step",      "8 x 10 directional derivatives",
};
static const double SIZES[4] = {1e-3, 5e-4, 2e-3, 1.5e-3};

static double run(const Library *l, Way way, long steps) {
    Component c = start(l, way == OMEGA);
    double t = 0, y[8] = {0}, inputs[4], sum = 0;
    void *state = NULL;
    static const unsigned known[10] = {0, 1, 2, 3, 10, 11, 12, 13, 14, 15}, unknown[8] = {4, 5, 6, 7, 8, 9, 10, 11};
    static const double one = 1;
    double begin = now();
    for (long k = 0; k < steps; k++) {
        const double *u = motion[k % PERIOD];
        double h = way == ALTERNATING ? SIZES[k & 3] : way == NEW_SIZES ? 1e-3 + 1e-10 * (double)k : 1e-3;
        if (way == DERIVATIVES) {
            for (int j = 0; j < 10; j++) l->derivative(c, unknown, 8, known + j, 1, &one, y);
            sum += y[0];
            continue;
        }
        write_inputs(inputs, u, way == OMEGA);
        if (way == SCALARS) {
            l->set(c, INPUTS, 1, inputs);
            l->set(c, INPUTS + 1, 1, inputs + 1);
        } else {
            l->set(c, INPUTS, way == OMEGA ? 4 : 2, inputs);
        }
        if (way == RATES) l->set_rates(c, INPUTS, 2, ORDERS, u + 2);
        if (way == STATES) l->get_state(c, &state), l->set_state(c, state);
        if (l->step(c, t, h, 1) != 0) fail("fmi2DoStep failed");
        t += h;
        if (way == SCALARS)
            for (int j = 0; j < 4; j++) l->get(c, OUTPUTS + j, 1, y + j);
        else
            l->get(c, OUTPUTS, 4, y);
        sum += y[0];
    }
    double each = (now() - begin) / (double)steps;
    if (!isfinite(sum)) fail("the outputs are not finite");
    if (state) l->free_state(c, &state);
    l->release(c);
    return each;
}

static double run_life(const Library *l, long times) {
    double begin = now();
    for (long k = 0; k < times; k++) l->release(start(l, 0));
    return (now() - begin) / (double)times;
}

/* Bytes on the heap per instance. */
static double memory(const Library *l) {
    enum { COUNT = 1000 };
    static Component c[COUNT];
    size_t before = mallinfo2().uordblks;
    for (int j = 0; j < COUNT; j++) c[j] = start(l, 0);
    size_t after = mallinfo2().uordblks;
    for (int j = 0; j < COUNT; j++) l->release(c[j]);
    return (double)(after - before) / COUNT;
}

static double run_many(const Library *l, int count, long rounds) {
    Component *c = malloc((size_t)count * sizeof *c);
    double y[4], inputs[2], t = 0;
    for (int j = 0; j < count; j++) c[j] = start(l, 0);
    double begin = now();
    for (long k = 0; k < rounds; k++) {
        for (int j = 0; j < count; j++) {
            write_inputs(inputs, motion[k % PERIOD], 0);
            l->set(c[j], INPUTS, 2, inputs);
            l->step(c[j], t, 1e-3, 1);
            l->get(c[j], OUTPUTS, 4, y);
        }
        t += 1e-3;
    }
    double each = (now() - begin) / (double)(rounds * count);
    for (int j = 0; j < count; j++) l->release(c[j]);
    free(c);
    return each;
}

typedef struct {
    const Library *l;
    long steps;
} Job;
static void *job(void *p) {
    run(((Job *)p)->l, VECTORS, ((Job *)p)->steps);
    return NULL;
}
/* Work for all of a core's adders and no memory: shows whether the machine's processors share a core. */
static void *spin(void *p) {
    unsigned long a = 0, b = 0, c = 0, d = 0, e = 0, f = 0;
    for (long k = 0; k < 40 * ((Job *)p)->steps; k++) {
        a += 1, b += 2, c += 3, d += 4, e += 5, f += 6;
        __asm__ volatile("" : "+r"(a), "+r"(b), "+r"(c), "+r"(d), "+r"(e), "+r"(f)); /* as written, please */
    }
    return NULL;
}
static double run_threads(void *(*work)(void *), const Library *l, int threads, long steps) {
    pthread_t ids[8];
    Job j = {l, steps};
    double begin = now();
    for (int k = 0; k < threads; k++) pthread_create(ids + k, NULL, work, &j);
    for (int k = 0; k < threads; k++) pthread_join(ids[k], NULL);
    return (now() - begin) / (double)(steps * threads);
}

/* The yardstick must compute the same: the largest difference of any output over Fig. 4. */
static double difference(const Library *l, const Library *other, Way way) {
    Component a = start(l, way == OMEGA), b = start(other, way == OMEGA);
    double y[4], z[4], t = 0, largest = 0;
    for (int k = 0; k < 2000; k++) {
        const double *u = motion[k % PERIOD], h = way == ALTERNATING ? SIZES[k / 3 & 3] : 1e-3;
        const size_t inputs = way == OMEGA ? 4 : 2;
        l->set(a, INPUTS, inputs, u), other->set(b, INPUTS, inputs, u);
        if (way == RATES) l->set_rates(a, INPUTS, 2, ORDERS, u + 2), other->set_rates(b, INPUTS, 2, ORDERS, u + 2);
        l->step(a, t, h, 1), other->step(b, t, h, 1);
        t += h;
        l->get(a, OUTPUTS, 4, y), other->get(b, OUTPUTS, 4, z);
        for (int j = 0; j < 4; j++) largest = fmax(largest, fabs(y[j] - z[j]));
    }
    l->release(a), other->release(b);
    return largest;
}

/* The largest error of roll and torque 1 over Fig. 4, against the FMU with the true slopes. */
static void errors(const Library *fmu, const Library *l, double *roll, double *torque) {
    Component a = start(fmu, 0), b = start(l, 1);
    double y[4], z[4], peak_roll = 0, peak_torque = 0;
    *roll = *torque = 0;
    for (int k = 0; k < 2000; k++) {
        const double *u = motion[k % PERIOD], *next = motion[(k + 1) % PERIOD];
        double slope[2] = {(next[0] - u[0]) / 1e-3, (next[1] - u[1]) / 1e-3};
        fmu->set(a, INPUTS, 2, u), l->set(b, INPUTS, 4, u);
        fmu->set_rates(a, INPUTS, 2, ORDERS, slope);
        fmu->step(a, 1e-3 * k, 1e-3, 1), l->step(b, 1e-3 * k, 1e-3, 1);
        fmu->get(a, OUTPUTS, 4, y), l->get(b, OUTPUTS, 4, z);
        *torque = fmax(*torque, fabs(y[0] - z[0])), peak_torque = fmax(peak_torque, fabs(y[0]));
        *roll = fmax(*roll, fabs(y[3] - z[3])), peak_roll = fmax(peak_roll, fabs(y[3]));
    }
    *roll /= peak_roll, *torque /= peak_torque;
    fmu->release(a), l->release(b);
}

static int by_size(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* A million steps, each with its own time: the median and the slowest. */
static void slowest(const Library *l, double *median, double *most) {
    enum { MILLION = 1000000 };
    static double times[MILLION];
    Component c = start(l, 0);
    double y[4], inputs[2], t = 0;
    memset(times, 1, sizeof times); /* no page of it is missing later */
    for (int k = 0; k < MILLION; k++) {
        double begin = now();
        write_inputs(inputs, motion[k % PERIOD], 0);
        l->set(c, INPUTS, 2, inputs);
        if (l->step(c, t, 1e-3, 1) != 0) fail("fmi2DoStep failed");
        l->get(c, OUTPUTS, 4, y);
        times[k] = now() - begin;
        t += 1e-3;
    }
    l->release(c);
    qsort(times, MILLION, sizeof *times, by_size);
    *median = times[MILLION / 2], *most = times[MILLION - 1];
}

/* The C sources beside the FMU with the library. */
static void compare(const Library *fmu, const Library *generated) {
    enum { ROUNDS = 4001, MILLIONS = 9 };
    static double ours[ROUNDS], theirs[ROUNDS];
    double most[2][MILLIONS], median[2];
    if (difference(fmu, generated, VECTORS) != 0) fail("the C sources compute something else");
    for (int r = 0; r < ROUNDS; r++) ours[r] = run(fmu, VECTORS, 1000), theirs[r] = run(generated, VECTORS, 1000);
    qsort(ours, ROUNDS, sizeof *ours, by_size), qsort(theirs, ROUNDS, sizeof *theirs, by_size);
    fprintf(stderr, "C sources: a step %.1f ns, least %.1f; library %.1f ns, least %.1f\n", 1e9 * theirs[ROUNDS / 2],
            1e9 * theirs[0], 1e9 * ours[ROUNDS / 2], 1e9 * ours[0]);
    /* Before all others on its processor, as on a real-time target, if that is allowed here; the least of several,
       because a virtual machine is interrupted all the same. */
    const struct sched_param first = {1}, usual = {0};
    const int allowed = sched_setscheduler(0, SCHED_FIFO, &first) == 0;
    for (int r = 0; r < MILLIONS; r++) {
        slowest(fmu, median, most[0] + r), slowest(generated, median + 1, most[1] + r);
    }
    if (allowed) sched_setscheduler(0, SCHED_OTHER, &usual);
    for (int k = 0; k < 2; k++) {
        qsort(most[k], MILLIONS, sizeof *most[k], by_size);
        fprintf(stderr, "a million steps%s, each timed: median %.0f ns, slowest %.1f us (the least of %d), %s\n",
                allowed ? "" : " without priority", 1e9 * median[k], 1e6 * most[k][0], MILLIONS,
                k ? "C sources" : "library");
    }
    printf("\n| C sources | ratio |\n|---|---|\n");
    printf("| a step of the C sources / of the library, medians | %.2f |\n", theirs[ROUNDS / 2] / ours[ROUNDS / 2]);
    printf("| slowest of a million steps / median, the least of %d runs, library | %.0f |\n", MILLIONS, most[0][0] / median[0]);
    printf("| slowest of a million steps / median, the least of %d runs, C sources | %.0f |\n", MILLIONS, most[1][0] / median[1]);
}

int main(int argc, char **argv) {
    if (argc < 5) fail("usage: whole GUID FMU.so BARE.so EULER.so GENERATED.so, or whole GUID LIBRARY.so WAY STEPS");
    guid = argv[1];
    make_motion();
    if (argc == 5) {
        Library alone = load("alone", argv[2]);
        run(&alone, (Way)strtol(argv[3], NULL, 10), strtol(argv[4], NULL, 10));
        return 0;
    }
    Library generated = load("C sources", argv[5]), fmu = load("FMU", argv[2]), bare = load("bare C", argv[3]), euler = load("Euler", argv[4]);
    const Way compared[] = {VECTORS, RATES, OMEGA, ALTERNATING};
    for (int j = 0; j < 4; j++) {
        double d = difference(&fmu, &bare, compared[j]);
        fprintf(stderr, "%-42s largest difference %.1e\n", WAYS[compared[j]], d);
        if (!(d < 1e-10)) fail("the bare C version computes something else");
    }
    double ours[WAYS_COUNT], theirs[WAYS_COUNT];
    double life = 1e9, one = 1e9, many = 1e9, slow = 1e9, single = 1e9, two = 1e9, spin_single = 1e9, spin_two = 1e9;
    for (int way = 0; way < WAYS_COUNT; way++) ours[way] = theirs[way] = 1e9;
    enum { ROUNDS = 25 };
    for (int r = 0; r < ROUNDS; r++) {
        for (int way = 0; way < WAYS_COUNT; way++) {
            long count = way == NEW_SIZES ? 4000 : way == DERIVATIVES ? 20000 : 100000;
            ours[way] = fmin(ours[way], run(&fmu, way, count));
            theirs[way] = fmin(theirs[way], run(&bare, way, count));
        }
        life = fmin(life, run_life(&fmu, 20000));
        one = fmin(one, run_many(&fmu, 1, 100000)), many = fmin(many, run_many(&fmu, 1000, 100));
        single = fmin(single, run_threads(job, &fmu, 1, 400000)), two = fmin(two, run_threads(job, &fmu, 2, 400000));
        spin_single = fmin(spin_single, run_threads(spin, NULL, 1, 400000));
        spin_two = fmin(spin_two, run_threads(spin, NULL, 2, 400000));
        slow = fmin(slow, run(&euler, OMEGA, 20000));
    }
    const double base = ours[VECTORS];
    printf("| what | FMU / bare C |\n|---|---|\n");
    for (int way = 0; way < WAYS_COUNT; way++) {
        printf("| %s | %.2f |\n", WAYS[way], ours[way] / theirs[way]);
        fprintf(stderr, "%-42s FMU %8.1f ns, bare C %8.1f ns\n", WAYS[way], 1e9 * ours[way], 1e9 * theirs[way]);
    }
    double roll, torque;
    errors(&fmu, &euler, &roll, &torque);
    printf("\n| what | ratio |\n|---|---|\n");
    printf("| new step size / known one | %.1f |\n", ours[NEW_SIZES] / base);
    printf("| step size alternating among 4 / constant | %.2f |\n", ours[ALTERNATING] / base);
    printf("| 1000 instances in turn / one, per step | %.2f |\n", many / one);
    printf("| two threads / one, throughput | %.2f |\n", single / two);
    printf("| the same of additions in registers: what the machine gives | %.2f |\n", spin_single / spin_two);
    printf("| instantiate, initialize and free / one step | %.1f |\n", life / base);
    printf("| memory of an instance / 4 KiB | %.2f |\n", memory(&fmu) / 4096);
    printf("| forward Euler in C, inner steps of 0.1 ms / FMU | %.1f |\n", slow / base);
    printf("| its error in roll and in torque, of the peak | %.1f %%, %.1f %% |\n", 100 * roll, 100 * torque);
    fprintf(stderr, "instantiate to free %.2f us\n", 1e6 * life);
    compare(&fmu, &generated);
    return 0;
}
