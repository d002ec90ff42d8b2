/* The frame of the test FMUs in C: all functions of FMI 2.0 and 3.0, the modes in which they are allowed, and the checks of their
   arguments. A model includes this file, and defines `struct Model`, which begins with `Fmu fmu`, and `behaviour`, whose functions
   calculate. The same library is an FMU of both FMI versions.

   Traits make an FMU faulty or unusual, so that one library serves many tests. The environment variable FMU_TRAITS lists them, separated
   by commas, or else the guid does, as in "{chatty,no_reset}". This file has the traits that concern any model. MINIMAL leaves the
   functions out that an FMU without optional capabilities does not need, and WITHOUT_NOMINALS and SYMBOL_MISSING break the linking.

   The headers of FMI are not used, so that the tests need only a compiler. The code is C and C++, and needs no mathematical library. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <float.h>
#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING };
enum { START = 1, INITIALIZATION = 2, STEP = 4, EVENT = 8, CONTINUOUS = 16, ENDED = 32, CONFIGURATION = 64 };
/* Sets of modes: all, those after the start, and those in which parameters, inputs and discrete inputs can be set. */
enum { ANY = 127, INITIALIZED = 126, FIXED = 3, INPUT = 31, DISCRETE = 15 };

typedef void (*Logger2)(void *, const char *, int, const char *, const char *, ...);
typedef void (*Logger3)(void *, int, const char *, const char *);
typedef struct {
    Logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void *finished, *environment;
} Callbacks;

/* The part of an instance that any model has. A saved state and a reset leave the members before `time` as they are. */
typedef struct {
    int fmi, cs, events, early, visible, logging, asynchronous;
    Callbacks callbacks;
    Logger3 logger3;
    void *environment;
    const char *given;
    char name[64];
    double calculated, *scratch;
    int counted;
    /* What the last step returned. */
    bool event, ended, returned_early;
    double last;
    double time, start, stop, tolerance;
    int mode, steps;
} Fmu;
typedef struct Model Model;

typedef enum { REAL, INTEGER, BOOLEAN, TEXT, LONG, NATURAL_LONG, BYTES } Kind;
/* Where the value of a variable is, the modes in which it can be set, and the range of a Real that can be set. A BOOLEAN is stored as
   an int, and a TEXT as an array of `count` characters. */
typedef struct {
    Kind kind;
    void *data;
    size_t count;
    int settable;
    double low, high;
} Place;
typedef struct {
    bool again, terminate, nominals, states, is_next;
    double next;
} Update;
typedef enum { SAVING, RESTORING, SERIALIZING, RESETTING } Copying;

/* The functions of a model. Those that are NULL do nothing. */
typedef struct {
    const char *token; /* or NULL, if every guid is right */
    size_t size, saved, state; /* of the model, of the part that is reset and saved, and the offset of its continuous states */
    bool configurable; /* has structural parameters */
    void (*attack)(void);
    int (*begin)(Model *m, const char *token, const char *resources);
    void (*end)(Model *m);
    void (*start)(Model *m); /* sets start values; all other values are 0 */
    bool (*place)(Model *m, Kind kind, uint32_t vr, Place *to);
    bool (*take)(Model *m, uint32_t vr, const void *value); /* before a value is set; false if the model ignores it */
    int (*enter)(Model *m, int mode);
    int (*step)(Model *m, double point, double size);
    int (*update)(Model *m, Update *to);
    int (*completed)(Model *m, bool *event);
    size_t (*count)(const Model *m, bool indicators);
    int (*derivatives)(Model *m, double *to);
    void (*indicators)(Model *m, double *to);
    int (*nominals)(Model *m, double *to);
    double (*partial)(const Model *m, uint32_t unknown, uint32_t known); /* NaN if one of them is wrong */
    const uint32_t *order; /* of the unknowns in ModelStructure, up to a 0 */
    void (*copy)(Model *m, Model *copy, Copying why);
    bool (*plausible)(const Model *copy);
    void (*slope)(Model *m, double value);
    size_t (*serialized)(Model *m, size_t size);
} Behaviour;
extern const Behaviour behaviour __attribute__((visibility("hidden")));

static char traits[500];
static unsigned choices = 1; /* how often the traits have changed */

static inline bool is(const char *name) {
    const char *found = traits;
    size_t length = *found ? strlen(name) : 0;
    while (length && (found = strstr(found, name))) {
        if ((found == traits || found[-1] == ',') && (found[length] == ',' || !found[length])) return true;
        found += length;
    }
    return false;
}
/* Whether the FMU has a trait. The answer is kept until the traits change, so that it takes no time. */
#define IS(name)                                                                                   \
    ({                                                                                             \
        static unsigned known_;                                                                    \
        if (known_ >> 1 != choices) known_ = choices << 1 | (unsigned)is(#name);                   \
        (bool)(known_ & 1);                                                                        \
    })
static void choose(const char *list, int length) {
    if (!strncmp(traits, list, (size_t)length) && !traits[length]) return;
    snprintf(traits, sizeof traits, "%.*s", length, list);
    choices++;
}

__attribute__((constructor)) static void loaded(void) {
    const char *list = getenv("FMU_TRAITS");
    if (list && strcmp(list, "none")) choose(list, (int)strlen(list));
}

__attribute__((destructor)) static void unloaded(void) {
    if (IS(unload_crashes)) abort();
    if (IS(exit_hangs)) pause();
}

/* A variable at an address, which can be set in some modes. */
static inline bool at(Place *to, Kind kind, void *data, int settable) {
    Place place = {kind, data, 1, settable, 0, 0};
    *to = place;
    return true;
}
static inline bool at_real(Place *to, double *data, int settable) { return at(to, REAL, data, settable); }
/* A Real that must be finite, and at least `low`. */
static inline bool at_finite(Place *to, double *data, int settable, double low) {
    at(to, REAL, data, settable);
    to->low = low, to->high = DBL_MAX;
    return true;
}
static inline bool calculated(Fmu *f, Place *to, double value) {
    f->calculated = value;
    return at(to, REAL, &f->calculated, 0);
}
static inline bool counted(Fmu *f, Place *to, Kind kind, int value) {
    f->counted = value;
    return at(to, kind, &f->counted, 0);
}

static void *first_environment;

static void *environment_of(Fmu *f) {
    if (IS(environment_lost) || IS(other_environment) || IS(other_thread)) return f;
    if (IS(null_environment)) return NULL;
    return IS(freed_environment) ? first_environment : f->environment;
}

/* Returns the number in a file of the resources. In FMI 2.0 their location is a URI, which must be decoded; in FMI 3.0 it is a path. */
static inline double read_resource(bool decodes, const char *location, const char *name) {
    char path[5000] = "", *to = path;
    const char *from = location ? location : "";
    double number = 0;
    unsigned code;
    if (strncmp(from, "file://", 7) == 0) from += 7;
    for (; *from && to < path + 4900; from++)
        if (decodes && *from == '%' && sscanf(from + 1, "%2x", &code) == 1) *to++ = (char)code, from += 2;
        else *to++ = *from;
    snprintf(to, 99, "/%s", name);
    FILE *file = fopen(path, "r");
    if (file) { if (fscanf(file, "%lf", &number) != 1) number = -1; fclose(file); }
    return number;
}

/* Calls the logger, in FMI 2.0 with arguments for the format. */
#define LOG(f, status, category, ...)                                                                              \
    do {                                                                                                           \
        if ((f)->fmi == 3) { if ((f)->logger3) (f)->logger3(environment_of(f), status, category, first(__VA_ARGS__)); } \
        else if ((f)->callbacks.logger)                                                                            \
            (f)->callbacks.logger(environment_of(f), IS(name_gone) ? (f)->given : (f)->name, status, category, __VA_ARGS__); \
    } while (0)
static inline const char *first(const char *format, ...) { return format; }

static int reject(void *c, const char *why) {
    Fmu *f = (Fmu *)c;
    if (f->logging && !IS(silent))
        LOG(f, ERROR, IS(category_unknown) ? "unheard of" : "logStatusError", IS(log_latin1) ? "rejet\xe9" : why);
    return ERROR;
}

#define ALLOW(modes)                                                       \
    Fmu *f = (Fmu *)c;                                                     \
    Model *m = (Model *)c;                                                 \
    (void)m;                                                               \
    if (!f) return ERROR;                                                  \
    if (!(f->mode & (modes))) return reject(f, "not allowed here");
#define NEED(condition, why) if (!(condition)) return reject(c, why);

static double *states_of(void *c) { return (double *)((char *)c + behaviour.state); }
static size_t count_of(const Model *m, bool indicators) { return behaviour.count ? behaviour.count(m, indicators) : 0; }
static int enter(Fmu *f, int mode) {
    int status = behaviour.enter ? behaviour.enter((Model *)f, mode) : OK;
    if (status <= WARNING) f->mode = mode;
    return status;
}

static void start(Fmu *f) {
    memset(&f->time, 0, behaviour.saved - offsetof(Fmu, time));
    f->mode = START;
    f->stop = INFINITY;
    f->ended = f->returned_early = false;
    behaviour.start((Model *)f);
}

static void *discard(Fmu *f) {
    free(f->scratch);
    if (f->fmi == 2 && (IS(memory) || IS(unchecked_memory))) f->callbacks.release(f);
    else free(f);
    return NULL;
}

static void *make(int fmi, const char *name, const char *token, const char *resources, int cs, int logging, const Callbacks *callbacks,
                  Logger3 logger3, void *environment) {
    Fmu *f;
    if (token && *token == '{') choose(token + 1, (int)strcspn(token + 1, ":}"));
    if (behaviour.attack) behaviour.attack();
    if (fmi == 2 && IS(memory) && (!callbacks->allocate || !callbacks->release)) {
        callbacks->logger(environment, name, ERROR, "error", "Missing memory callback function");
        return NULL;
    }
    f = (Fmu *)(fmi == 2 && (IS(memory) || IS(unchecked_memory)) ? callbacks->allocate(1, behaviour.size) : calloc(1, behaviour.size));
    f->fmi = fmi, f->cs = cs, f->logging = logging, f->logger3 = logger3, f->environment = environment, f->given = name;
    if (callbacks) f->callbacks = *callbacks;
    if (!first_environment) first_environment = environment;
    snprintf(f->name, sizeof f->name, "%s", name ? name : "");
    start(f);
    if (!name || !*name || !token || (behaviour.token && strcmp(token, behaviour.token) && !IS(token_ignored))) {
        f->logging = 1;
        reject(f, "no name or another token");
        return discard(f);
    }
    f->scratch = (double *)malloc(sizeof *f->scratch);
    if (!IS(unwritten_memory)) *f->scratch = 0;
    if (behaviour.begin && behaviour.begin((Model *)f, token, resources) != OK) return discard(f);
    return f;
}

static void release(void *c) {
    Fmu *f = (Fmu *)c;
    if (IS(free_null_crashes)) *(volatile char *)f = *(volatile char *)f;
    if (!f) return;
    if (behaviour.end) behaviour.end((Model *)f);
    discard(f);
}

static const size_t SIZE_OF[] = {sizeof(double), sizeof(int32_t), 0, sizeof(char *), sizeof(int64_t), sizeof(uint64_t), 0};

static int get(void *c, Kind kind, const uint32_t *vr, size_t n, void *value, size_t n_values, size_t *sizes) {
    size_t size = SIZE_OF[kind], used = 0;
    Place place;
    ALLOW(ANY)
    if (size == 0) size = f->fmi == 3 ? sizeof(bool) : sizeof(int);
    if (IS(get_after_end_rejected) && f->mode == ENDED) return reject(f, "it is over");
    if (n && (!vr || !value) && !IS(null_crashes)) return reject(f, "an array is NULL");
    if (IS(crash_amid) && f->steps == 7) abort();
    for (size_t i = 0; i < n; i++) {
        bool known = behaviour.place(m, kind, vr[i], &place) && place.kind == kind;
        if (IS(reference_crashes) && !known) abort();
        if (IS(reference_exits) && !known) exit(3);
        NEED(known, "an unknown reference")
        used += kind == TEXT || kind == BYTES ? 1 : place.count;
    }
    if (n_values != SIZE_MAX) NEED(used == n_values, "sizes that differ")
    used = 0;
    for (size_t i = 0; i < n; i++) {
        char *to = (char *)value + used * size;
        if (IS(reference_once) && i && vr[i] == vr[i - 1]) { used++; continue; }
        behaviour.place(m, kind, vr[i], &place);
        if (kind == TEXT) {
            ((const char **)value)[used++] = IS(string_latin1) ? "wag\xf6n" : (const char *)place.data;
        } else if (kind == BYTES) {
            sizes[used] = place.count, ((const void **)value)[used++] = place.data;
        } else if (kind == BOOLEAN) {
            unsigned char flag = IS(boolean_two) ? 2 : *(int *)place.data != 0;
            memset(to, 0, size), memcpy(to, &flag, 1), used++;
        } else {
            if (!(kind == INTEGER && IS(output_unwritten))) memcpy(to, place.data, place.count * size);
            if (IS(early_read_wrong) && kind == REAL && f->mode == START && place.settable == FIXED) memset(to, 0, size);
            if (kind == INTEGER && IS(integer_out_of_range)) ((int32_t *)value)[used] += 999;
            used += place.count;
        }
    }
    if (kind == REAL) {
        if (IS(write_const) && n) *(uint32_t *)vr = 0;
        if (IS(write_past)) ((double *)value)[n] = 0;
        if (IS(write_before)) ((double *)value)[-1] = 0;
        if (IS(status_unknown) && f->steps == 2) return 17;
    }
    return IS(warning) ? WARNING : OK;
}

/* Sets values after all of them have been checked, so that a rejected call changes nothing. */
static int set(void *c, Kind kind, const uint32_t *vr, size_t n, const void *value, size_t n_values, const size_t *sizes) {
    size_t size = SIZE_OF[kind], used = 0;
    ALLOW(START | INITIALIZATION | STEP | EVENT | CONTINUOUS | CONFIGURATION | (IS(set_after_end) || IS(set_after_end_crashes) ? ENDED : 0))
    if (size == 0) size = f->fmi == 3 ? sizeof(bool) : sizeof(int);
    if (IS(set_after_end_crashes) && f->mode == ENDED) abort();
    NEED(!n || (vr && value), "an array is NULL")
    for (int pass = 0; pass < 2; pass++) {
        used = 0;
        for (size_t i = 0; i < n; i++) {
            Place place;
            const char *from = (const char *)value + used * size, *text = kind == TEXT ? ((const char **)value)[i] : NULL;
            bool known = behaviour.place(m, kind, vr[i], &place) && place.kind == kind;
            size_t count = kind == TEXT ? 1 : place.count;
            if (pass == 0) {
                int allowed = place.settable;
                if (IS(set_after_end)) allowed |= ENDED;
                NEED(known && (f->mode & allowed), "it cannot be set, or not here")
                NEED(kind != TEXT || (text && strlen(text) < place.count), "no such text")
                NEED(n_values == SIZE_MAX || used + count <= n_values || kind == BYTES, "too few values")
                if (kind == REAL && IS(half_set) && (place.settable & STEP)) *(double *)place.data = *(const double *)from;
                double number = kind == REAL ? *(const double *)from : kind == INTEGER ? *(const int32_t *)from
                              : kind == NATURAL_LONG ? (double)*(const uint64_t *)from : 0;
                if (place.low < place.high && !(number >= place.low && number <= place.high)) {
                    if (IS(discard_changes)) { *states_of(c) += 1; reject(c, "no such value"); return DISCARD; }
                    return reject(c, "no such value");
                }
                if (kind == BYTES) NEED(sizes[i] <= 64, "too many bytes")
            } else if (kind == TEXT) {
                if (behaviour.take && !behaviour.take(m, vr[i], text)) { used++; continue; }
                strcpy((char *)place.data, text);
                if (IS(string_cut)) ((char *)place.data)[8] = 0;
                if (IS(string_leaks) && !malloc(40)) return ERROR;
            } else if (kind == BYTES) {
                memcpy(place.data, ((const void *const *)value)[i], sizes[i]);
                behaviour.take(m, vr[i], &sizes[i]);
            } else if (kind == BOOLEAN) {
                int flag = 0;
                memcpy(&flag, from, size);
                *(int *)place.data = flag;
            } else if (!behaviour.take || behaviour.take(m, vr[i], from)) memcpy(place.data, from, count * size);
            used += count;
        }
        if (kind != BYTES) NEED(n_values == SIZE_MAX || used == n_values, "sizes that differ")
        if (kind == REAL && IS(read_past) && n && ((const double *)value)[n] == 1e99) return ERROR;
    }
    return IS(warning) ? WARNING : OK;
}

static int get_none(void *c, size_t n) { ALLOW(ANY) return n ? reject(c, "there are none") : OK; }

static int initialize(void *c, double from, double stop) {
    ALLOW(START)
    NEED(isfinite(from) && fabs(from) <= 1e9, "no such time")
    f->time = f->start = from;
    f->stop = stop;
    return enter(f, INITIALIZATION);
}

static int do_step(void *c, double point, double size, bool no_set) {
    if (c && no_set && IS(announcement_counts)) *states_of(c) += 1e-6;
    int status;
    ALLOW(STEP)
    if (IS(endless_step) && !(size < 1e9)) for (;;) usleep(1000);
    if (IS(long_step_hangs) && size > 1e3 && size < 1e4) for (;;) usleep(1000);
    if (IS(step_rejected_halfway) && !(size > 0)) *states_of(c) += 0.01;
    NEED(isfinite(point) && isfinite(size) && size > 0, "no such step")
    NEED(fabs(point - f->time) <= 1e-9 * (1 + fabs(point)), "another time")
    f->event = f->ended = f->returned_early = false;
    f->last = point + size;
    status = behaviour.step(m, point, size);
    if (status >= ERROR) return status;
    f->steps++;
    if (IS(last_time_wrong)) f->last = point;
    if (IS(last_time_of_begin)) f->last -= 0.01;
    if (IS(step_prints)) puts("a step");
    if (IS(step_adds)) *states_of(c) += 1e-7;
    if (IS(leak_step) && !malloc(40)) return ERROR;
#ifdef __SSE__
    if (IS(rounding_changed)) { unsigned control = 0x9fc0; __asm__ volatile("ldmxcsr %0" : : "m"(control)); }
#endif
    if (IS(locale_changed)) setlocale(LC_ALL, "C.UTF-8");
    if (IS(log_when_off)) LOG(f, OK, "logStatusError", "a step");
    return status;
}

static int update(void *c, Update *to) {
    ALLOW(EVENT)
    memset(to, 0, sizeof *to);
    return behaviour.update ? behaviour.update(m, to) : OK;
}

#ifndef MINIMAL
static int directional(void *c, const uint32_t *unknown, size_t nu, const uint32_t *known, size_t nk, const double *seed, double *out,
                       bool adjoint) {
    uint32_t own[8];
    double *sums;
    ALLOW(INITIALIZED)
    NEED(behaviour.partial, "not supported")
    NEED((!nu || unknown) && (!nk || known) && (!(adjoint ? nu : nk) || seed) && (!(adjoint ? nk : nu) || out), "an array is NULL")
    for (size_t i = 0; i < nu; i++)
        for (size_t j = 0; j < nk; j++) NEED(!isnan(behaviour.partial(m, unknown[i], known[j])), "an unknown or known that is none")
    sums = (double *)calloc(nu + nk + 1, sizeof *sums);
    if (IS(order_ignored) && nu <= 8 && !adjoint) {
        /* Sorts the unknowns as in ModelStructure, as if their order in the call did not matter. */
        size_t next = 0;
        for (const uint32_t *k = behaviour.order; *k; k++)
            for (size_t i = 0; i < nu; i++) if (unknown[i] == *k) own[next++] = unknown[i];
        if (next == nu) unknown = own;
    }
    for (size_t i = 0; i < nu; i++)
        for (size_t j = 0; j < nk; j++) {
            double d = behaviour.partial(m, unknown[i], known[j]);
            if (adjoint && IS(adjoint_off)) d *= 1 + 1e-9;
            if (IS(directional_imprecise)) d *= 1 + 1e-6;
            sums[adjoint ? j : i] += d * seed[adjoint ? i : j];
        }
    if (IS(directional_not_linear) && nk > 1 && seed[0] != 0 && seed[1] != 0) sums[0] += 1;
    for (size_t i = 0; i < (adjoint ? nk : nu); i++) out[i] = sums[i] + (IS(directional_added) ? out[i] : 0);
    free(sums);
    if (IS(derivative_changes)) *states_of(c) += 1e-8;
    return OK;
}

static void copy_saved(void *to, const void *from) {
    size_t begin = offsetof(Fmu, time);
    memcpy((char *)to + begin, (const char *)from + begin, behaviour.saved - begin);
}

/* Addresses of serialized states with the trait bytes_with_address. */
static char *secret[4096];
static unsigned secrets;

#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Functions of both FMI versions whose arguments are the same. */
#define BOTH_AS(name2, name3, parameters, arguments, ...) \
    int fmi2##name2 parameters __VA_ARGS__                \
    int fmi3##name3 parameters { return fmi2##name2 arguments; }
#define BOTH(name, parameters, arguments, ...) BOTH_AS(name, name, parameters, arguments, __VA_ARGS__)

BOTH(ExitInitializationMode, (void *c), (c), { ALLOW(INITIALIZATION) return enter(f, f->cs && !f->events ? STEP : EVENT); })
BOTH(Terminate, (void *c), (c), {
    ALLOW(STEP | EVENT | CONTINUOUS)
    if (IS(name_gone)) LOG(f, OK, "logStatusError", "the end");
    if (IS(terminate_rejected) && f->steps > 1) return reject(f, "not yet");
    return enter(f, ENDED);
})
BOTH(Reset, (void *c), (c), {
    int status;
    ALLOW(ANY)
    if (IS(reset_rejected) && f->mode == ENDED) return reject(f, "it is over");
    Model *before = (Model *)malloc(behaviour.size);
    memcpy((void *)before, c, behaviour.size);
    status = behaviour.enter ? behaviour.enter(m, START) : OK;
    if (status <= WARNING) start(f);
    if (behaviour.copy) behaviour.copy(m, before, RESETTING);
    free(before);
    return status;
})
BOTH(EnterEventMode, (void *c), (c), {
    ALLOW(CONTINUOUS | EVENT | STEP)
    NEED(f->mode != STEP || f->events, "no event mode was agreed upon")
    return enter(f, EVENT);
})
BOTH(EnterContinuousTimeMode, (void *c), (c), { ALLOW(EVENT) NEED(!f->cs, "not in Co-Simulation") return enter(f, CONTINUOUS); })
BOTH(SetTime, (void *c, double time), (c, time), { ALLOW(CONTINUOUS) NEED(isfinite(time), "no such time") f->time = time; return OK; })
BOTH(SetContinuousStates, (void *c, const double *x, size_t n), (c, x, n), {
    ALLOW(CONTINUOUS)
    NEED(n == count_of(m, false) && (x || !n), "another number of states")
    for (size_t i = 0; i < n; i++) NEED(isfinite(x[i]), "no such states")
    if (behaviour.take && !behaviour.take(m, UINT32_MAX, x)) return OK;
    if (n) memcpy(states_of(c), x, n * sizeof *x);
    return OK;
})
#define VECTOR_OF(name, modes, indicators, ...) \
    BOTH(name, (void *c, double *x, size_t n), (c, x, n), { ALLOW(modes) NEED(n == count_of(m, indicators) && (x || !n), "another length") __VA_ARGS__ })
VECTOR_OF(GetContinuousStates, INITIALIZED, false, { if (n) memcpy(x, states_of(c), n * sizeof *x); return OK; })
VECTOR_OF(GetEventIndicators, INITIALIZED, true, { if (n) behaviour.indicators(m, x); return OK; })
VECTOR_OF(GetDerivatives, INITIALIZED, false, {
    int status = n ? behaviour.derivatives(m, x) : OK;
    if (IS(vector_swapped)) { double swapped = x[0]; x[0] = x[1]; x[1] = swapped; }
    return status;
})
int fmi3GetContinuousStateDerivatives(void *c, double *x, size_t n) { return fmi2GetDerivatives(c, x, n); }
#ifndef WITHOUT_NOMINALS
VECTOR_OF(GetNominalsOfContinuousStates, ANY, false, {
    for (size_t i = 0; i < n; i++) x[i] = 1;
    if (IS(nominal_zero)) x[0] = 0;
    return behaviour.nominals ? behaviour.nominals(m, x) : OK;
})
#endif

#ifndef MINIMAL
int fmi2SetDebugLogging(void *c, int on, size_t n, const char *const *categories) {
    ALLOW(ANY)
    NEED(!n || categories, "an array is NULL")
    for (size_t i = 0; i < n; i++) NEED(categories[i] && !strcmp(categories[i], "logStatusError"), "an unknown category")
    if (IS(logging_switched) && f->mode > INITIALIZATION) *states_of(c) += 1e-6;
    f->logging = on;
    return OK;
}
int fmi3SetDebugLogging(void *c, bool on, size_t n, const char *const *categories) { return fmi2SetDebugLogging(c, on, n, categories); }
BOTH_AS(GetFMUstate, GetFMUState, (void *c, void **state), (c, state), {
    ALLOW(ANY)
    NEED(state, "a handle is NULL")
    if (IS(state_not_supported)) return reject(f, "not supported");
    if (!(IS(handle_not_reused) && *state)) {
        if (!*state) *state = calloc(1, behaviour.size);
        copy_saved(*state, f);
    }
    if (behaviour.copy) behaviour.copy(m, (Model *)*state, SAVING);
    if (IS(save_changes)) *states_of(c) += 1e-6;
    if (IS(leak_state) && !malloc(16)) return ERROR;
    return OK;
})
BOTH_AS(SetFMUstate, SetFMUState, (void *c, void *state), (c, state), {
    ALLOW(ANY)
    NEED(state, "a state is NULL")
    if (behaviour.copy) behaviour.copy(m, (Model *)state, RESTORING);
    copy_saved(f, state);
    if (IS(restore_consumes)) *states_of(state) = 0;
    return OK;
})
BOTH_AS(FreeFMUstate, FreeFMUState, (void *c, void **state), (c, state), {
    ALLOW(ANY)
    if (!state) return OK;
    free(*state);
    if (!IS(freed_handle_stays)) *state = NULL;
    if (IS(free_state_fails)) return reject(f, "a state cannot be freed");
    return OK;
})
BOTH_AS(SerializedFMUstateSize, SerializedFMUStateSize, (void *c, void *state, size_t *size), (c, state, size), {
    ALLOW(ANY)
    NEED(state && size, "NULL")
    *size = behaviour.saved + 8;
    if (behaviour.serialized) *size = behaviour.serialized(m, *size);
    return OK;
})
BOTH_AS(SerializeFMUstate, SerializeFMUState, (void *c, void *state, char *bytes, size_t size), (c, state, bytes, size), {
    Model *copy;
    ALLOW(ANY)
    NEED(state && bytes && size >= behaviour.saved + 8, "no room")
    copy = (Model *)calloc(1, behaviour.size);
    copy_saved(copy, state);
    if (behaviour.copy) behaviour.copy(m, copy, SERIALIZING);
    memset(bytes, 0, size);
    memcpy(bytes, "testfmu1", 8);
    if (IS(bytes_with_address)) {
        char **own = &secret[secrets++ % 4096];
        *own = (char *)copy;
        memcpy(bytes + 8, &own, sizeof own);
        return OK;
    }
    memcpy(bytes + 8, copy, behaviour.saved);
    free(copy);
    return OK;
})
BOTH_AS(DeSerializeFMUstate, DeserializeFMUState, (void *c, const char *bytes, size_t size, void **state), (c, bytes, size, state), {
    Fmu *copy;
    ALLOW(ANY)
    NEED(state && bytes && (size >= behaviour.saved + 8 || IS(bytes_crash)) && !memcmp(bytes, "testfmu1", 8), "no state")
    copy = (Fmu *)calloc(1, behaviour.size);
    if (IS(bytes_with_address)) { char **from; memcpy(&from, bytes + 8, sizeof from); memcpy(copy, *from, behaviour.saved); }
    else memcpy(copy, bytes + 8, behaviour.saved);
    if (!isfinite(copy->time) || fabs(copy->time) > 1e9 || !copy->mode || copy->mode & (copy->mode - 1) ||
        (behaviour.plausible && !behaviour.plausible((Model *)copy))) { free(copy); return reject(f, "no state"); }
    free(*state);
    *state = copy;
    return OK;
})

int fmi2GetDirectionalDerivative(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, double *out) {
    return directional(c, u, nu, k, nk, seed, out, false);
}
int fmi3GetDirectionalDerivative(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns,
                                 double *out, size_t no) {
    if (c) NEED(ns == nk && no == nu, "sizes that differ")
    return directional(c, u, nu, k, nk, seed, out, false);
}
int fmi3GetAdjointDerivative(void *c, const uint32_t *u, size_t nu, const uint32_t *k, size_t nk, const double *seed, size_t ns,
                             double *out, size_t no) {
    if (c) NEED(ns == nu && no == nk, "sizes that differ")
    return directional(c, u, nu, k, nk, seed, out, true);
}
/* Functions that reject any call, whatever their other arguments are. */
#define REJECTED(name) int name(void *c) { return c ? reject(c, "not supported") : ERROR; }
REJECTED(fmi2GetRealOutputDerivatives) REJECTED(fmi2CancelStep) REJECTED(fmi3GetNumberOfVariableDependencies)
REJECTED(fmi3GetVariableDependencies) REJECTED(fmi3SetIntervalDecimal) REJECTED(fmi3SetIntervalFraction)
REJECTED(fmi3SetShiftDecimal) REJECTED(fmi3SetShiftFraction) REJECTED(fmi3EvaluateDiscreteStates) REJECTED(fmi3GetOutputDerivatives)
REJECTED(fmi3ActivateModelPartition)
#ifndef CLOCKS /* A model with clocks defines these functions. */
REJECTED(fmi3GetClock) REJECTED(fmi3SetClock) REJECTED(fmi3GetIntervalDecimal) REJECTED(fmi3GetIntervalFraction)
REJECTED(fmi3GetShiftDecimal) REJECTED(fmi3GetShiftFraction)
#endif
void *fmi3InstantiateScheduledExecution(void) { return NULL; }
int fmi2SetRealInputDerivatives(void *c, const uint32_t *vr, size_t n, const int *order, const double *value) {
    ALLOW(ANY)
    (void)vr; (void)order;
    NEED(behaviour.slope, "not supported")
    if (n) behaviour.slope(m, value[0]);
    return OK;
}
int fmi2GetStatus(void *c, int kind, int *value) {
    ALLOW(STEP | ENDED)
    if (kind || !f->asynchronous) return DISCARD;
    *value = __atomic_load_n(&f->asynchronous, __ATOMIC_ACQUIRE) == 1 ? PENDING : OK;
    return OK;
}
int fmi2GetIntegerStatus(void *c) { ALLOW(STEP | ENDED) return DISCARD; }
int fmi2GetStringStatus(void *c) { ALLOW(STEP | ENDED) return DISCARD; }
#endif

/* FMI 2.0. */
const char *fmi2GetVersion(void) { return IS(version_wrong) ? "2.1" : "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources, const Callbacks *callbacks, int visible,
                      int logging) {
    if (!callbacks) return NULL;
    Fmu *f = (Fmu *)make(2, name, token, resources, type == 1, logging, callbacks, NULL, callbacks->environment);
    if (f) f->visible = visible;
    return f;
}
void fmi2FreeInstance(void *c) { release(c); }
int fmi2SetupExperiment(void *c, int defined, double tolerance, double from, int stops, double stop) {
    ALLOW(START)
    NEED(isfinite(from) && fabs(from) <= 1e9 && !(IS(setup_rejects_negative) && from < 0), "no such time")
    f->time = from;
    f->stop = stops ? stop : INFINITY;
    f->tolerance = defined ? tolerance : -1;
    return OK;
}
int fmi2EnterInitializationMode(void *c) { return initialize(c, c ? ((Fmu *)c)->time : 0, c ? ((Fmu *)c)->stop : 0); }
typedef struct { int again, terminate, nominals, states, is_next; double next; } Event2;
int fmi2NewDiscreteStates(void *c, Event2 *to) {
    Update u = {false, false, false, false, false, 0};
    if (c) NEED(to, "NULL")
    int status = update(c, &u);
    if (status > WARNING) return status;
    Event2 event = {u.again, u.terminate, u.nominals, u.states, u.is_next, u.next};
    *to = event;
    return status;
}
int fmi2CompletedIntegratorStep(void *c, int no_set, int *event, int *terminate) {
    ALLOW(CONTINUOUS)
    (void)no_set;
    NEED(event && terminate, "a flag is NULL")
    bool wants = false;
    int status = behaviour.completed ? behaviour.completed(m, &wants) : OK;
    f->steps++, *event = wants, *terminate = 0;
    return status;
}
int fmi2DoStep(void *c, double point, double size, int no_set) { return do_step(c, point, size, no_set); }
int fmi2GetRealStatus(void *c, int kind, double *value) { ALLOW(STEP | ENDED) if (kind != 2) return DISCARD; *value = f->last; return OK; }
int fmi2GetBooleanStatus(void *c, int kind, int *value) { ALLOW(STEP | ENDED) if (kind != 3) return DISCARD; *value = f->ended; return OK; }
#define ACCESS2(name, type, kind)                                                                                                           \
    int fmi2Get##name(void *c, const uint32_t *vr, size_t n, type *value) { return get(c, kind, vr, n, value, SIZE_MAX, NULL); }            \
    int fmi2Set##name(void *c, const uint32_t *vr, size_t n, const type *value) { return set(c, kind, vr, n, value, SIZE_MAX, NULL); }
ACCESS2(Real, double, REAL) ACCESS2(Integer, int, INTEGER) ACCESS2(Boolean, int, BOOLEAN) ACCESS2(String, char *, TEXT)

/* FMI 3.0. */
const char *fmi3GetVersion(void) { return IS(version_wrong) ? "2.0" : "3.0"; }
void *fmi3InstantiateModelExchange(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                   void *environment, Logger3 log) {
    Fmu *f = (Fmu *)make(3, name, token, resources, 0, logging, NULL, log, environment);
    if (f) f->visible = visible;
    return f;
}
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging, bool events,
                                  bool early, const uint32_t *vr, size_t n, void *environment, Logger3 log, void *intermediate) {
    Fmu *f = (Fmu *)make(3, name, token, resources, 1, logging, NULL, log, environment);
    (void)vr; (void)n; (void)intermediate;
    if (f) f->visible = visible, f->early = early, f->events = events;
    return f;
}
void fmi3FreeInstance(void *c) { release(c); }
int fmi3EnterInitializationMode(void *c, bool defined, double tolerance, double from, bool stops, double stop) {
    if (c) ((Fmu *)c)->tolerance = defined ? tolerance : -1;
    return initialize(c, from, stops ? stop : INFINITY);
}
int fmi3UpdateDiscreteStates(void *c, bool *again, bool *terminate, bool *nominals, bool *states, bool *is_next, double *next) {
    Update u = {false, false, false, false, false, 0};
    if (c) NEED(again && terminate && nominals && states && is_next && next, "a flag is NULL")
    int status = update(c, &u);
    if (status > WARNING) return status;
    *again = u.again, *terminate = u.terminate, *nominals = u.nominals, *states = u.states, *is_next = u.is_next, *next = u.next;
    return status;
}
int fmi3CompletedIntegratorStep(void *c, bool no_set, bool *event, bool *terminate) {
    int wants, ends, status;
    if (c) NEED(event && terminate, "a flag is NULL")
    status = fmi2CompletedIntegratorStep(c, no_set, &wants, &ends);
    if (status <= WARNING) *event = wants, *terminate = false;
    return status;
}
int fmi3DoStep(void *c, double point, double size, bool no_set, bool *event, bool *terminate, bool *early, double *last) {
    Fmu *f = (Fmu *)c;
    if (c) NEED(event && terminate && early && last, "a flag is NULL")
    int status = do_step(c, point, size, no_set);
    if (status <= DISCARD) *event = f->event, *terminate = f->ended, *early = f->returned_early, *last = f->last;
    return status;
}
int fmi3EnterStepMode(void *c) { ALLOW(EVENT) NEED(f->cs, "not in Model Exchange") return enter(f, STEP); }
int fmi3GetNumberOfContinuousStates(void *c, size_t *n) { ALLOW(ANY) NEED(n, "NULL") *n = count_of(m, false); return OK; }
int fmi3GetNumberOfEventIndicators(void *c, size_t *n) { ALLOW(ANY) NEED(n, "NULL") *n = count_of(m, true); return OK; }
int fmi3EnterConfigurationMode(void *c) { ALLOW(START) NEED(behaviour.configurable, "not supported") f->mode = CONFIGURATION; return OK; }
int fmi3ExitConfigurationMode(void *c) { ALLOW(CONFIGURATION) f->mode = START; return behaviour.enter(m, CONFIGURATION); }
#define ACCESS3(name, type, kind)                                                                                                           \
    int fmi3Get##name(void *c, const uint32_t *vr, size_t n, type *value, size_t nv) { return get(c, kind, vr, n, value, nv, NULL); }       \
    int fmi3Set##name(void *c, const uint32_t *vr, size_t n, const type *value, size_t nv) { return set(c, kind, vr, n, value, nv, NULL); }
ACCESS3(Float64, double, REAL) ACCESS3(Int32, int32_t, INTEGER) ACCESS3(Boolean, bool, BOOLEAN) ACCESS3(String, char *, TEXT)
ACCESS3(Int64, int64_t, LONG) ACCESS3(UInt64, uint64_t, NATURAL_LONG)
int fmi3GetBinary(void *c, const uint32_t *vr, size_t n, size_t *sizes, const void **value, size_t nv) {
    return get(c, BYTES, vr, n, value, nv, sizes);
}
int fmi3SetBinary(void *c, const uint32_t *vr, size_t n, const size_t *sizes, const void *const *value, size_t nv) {
    return set(c, BYTES, vr, n, value, nv, sizes);
}
/* Types of which no model has a variable. */
#define NONE(name)                                                                                                               \
    int fmi3Get##name(void *c, const uint32_t *vr, size_t n, void *value, size_t nv) { (void)vr, (void)value, (void)nv; return get_none(c, n); } \
    int fmi3Set##name(void *c, const uint32_t *vr, size_t n, const void *value, size_t nv) { (void)vr, (void)value, (void)nv; return get_none(c, n); }
NONE(Float32) NONE(Int8) NONE(UInt8) NONE(Int16) NONE(UInt16) NONE(UInt32)

#ifdef __cplusplus
}
#endif
