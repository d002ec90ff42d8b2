/* An FMU of FMI 2.0 and 3.0 that behaves like FMUs of other producers. Its guid selects the behaviour (manner), so that one library can be
 * packed into many FMUs. MANNERS lists the manners and, for most of them, tools in which they were observed.
 *
 * The model: y is the integral of u, plus `gain`. This file is compiled without -lm, as C and as C++. */
#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <fenv.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "fmi2Functions.h"
#undef fmi2TypesPlatform
#include "fmi3Functions.h"

#define MANNERS(M) \
    M(plain) \
    M(memory)              /* Needs the memory callbacks: OpenModelica 1.12 to 1.24, 20-sim. */ \
    M(unchecked_memory)    /* Calls the memory callbacks without checking for NULL: HIFSuite, Vector. */ \
    M(other_environment)   /* Passes its own pointer to the logger: UniFMU, Overture. */ \
    M(null_environment)    /* Passes NULL to the logger: wrappers that copy only the functions. */ \
    M(freed_environment)   /* Passes the environment of an earlier instance: libraries with a global callback struct. */ \
    M(thread)              /* Logs from its own thread: UniFMU and other FMUs that connect to a server. */ \
    M(other_thread)        /* Logs from its own thread and passes its own pointer: UniFMU. */ \
    M(free)                /* Logs while it is freed: OpenModelica. */ \
    M(format)              /* Passes a printf format with arguments to the logger: OpenModelica, FMU SDK. */ \
    M(percent)             /* Logs text that contains percent signs, without arguments: Reference FMUs with paths of resources. */ \
    M(references)          /* Logs text that refers to variables, as section 2.1.5 of FMI 2.0 describes. */ \
    M(null_resources)      /* Accepts only NULL as the location of its resources, because it has none. */ \
    M(chatty)              /* Logs each step: OpenModelica. */ \
    M(null_texts)          /* Passes NULL as category and message. */ \
    M(resources)           /* Reads a file of its resources by URI: Dymola, OpenModelica. */ \
    M(tolerance)           /* Has a solver that uses the tolerance of the experiment: Dymola. */ \
    M(stop_time)           /* Needs a stop time: exports of tools with a fixed simulation interval. */ \
    M(pending)             /* Performs steps of FMI 2.0 in a thread and returns fmi2Pending: FMUs that run asynchronously. */ \
    M(warning)             /* Returns fmi2Warning from every call: Hopsan. */ \
    M(discard)             /* Returns fmi2Discard from t = 0.5 on: Dymola at an event that it cannot handle. */ \
    M(once)                /* Allows only one instance per process: JModelica, 20-sim. */ \
    M(directory)           /* Changes the working directory: tools that read tables by relative paths. */ \
    M(locale)              /* Changes the locale: exports with a GUI toolkit. */ \
    M(rounding)            /* Changes the rounding mode and unmasks floating-point exceptions: Fortran runtimes, Altair. */ \
    M(output)              /* Prints to stdout: Hopsan, PythonFMU. */ \
    M(libm)                /* Uses libm but is not linked to it: many C exports. */ \
    M(exceptions)          /* Throws and catches C++ exceptions: JModelica, CATIA, HIFSuite. */ \
    M(no_reset)            /* Returns an error from reset: many tools. */ \
    M(huge_bytes)          /* Reports SIZE_MAX bytes as the size of a binary value. */ \
    M(huge_state)          /* Reports a serialized state of 2^46 bytes. */ \
    M(endless_state)       /* Reports a serialized state of SIZE_MAX bytes. */ \
    M(growing_state)       /* Reports a larger size of the serialized state with each call. */

#define ITEM(name) name##_,
enum { MANNERS(ITEM) COUNT };
#define NAME(name) #name,
static const char *const NAMES[] = {MANNERS(NAME)};

/* Value references in both FMI versions. */
enum { U = 1, Y, GAIN, TOLERANCE, STOP, LABEL, ECHO, COUNTER, WIDE, WIDE_OUT, BYTES, BYTES_OUT, SIZE, VECTOR, SUM, VALVE, NATURAL, SCALE };

typedef struct {
    int manner, is_fmi3, logging;
    fmi2CallbackFunctions callbacks;
    fmi3LogMessageCallback log3;
    void *environment;
    char *name;
    double u, slope, y, gain, tolerance, stop, time, scale, vector[8];
    int32_t counter, valve, on;
    int64_t wide;
    uint64_t natural, size;
    char label[64];
    unsigned char bytes[64];
    size_t n_bytes;
    int has_tolerance, has_stop, configuring;
    volatile int steps_done, ends;
    pthread_t thread;
} Instance;

static int alive;
static void *first_environment;

static void *environment_of(Instance *i) {
    switch (i->manner) {
    case other_environment_:
    case other_thread_: return i;
    case null_environment_: return NULL;
    case freed_environment_: return first_environment;
    default: return i->environment;
    }
}

#define LOG(i, status, category, ...) \
    do { \
        if ((i)->is_fmi3) (i)->log3(environment_of(i), (fmi3Status)(status), category, first(__VA_ARGS__)); \
        else (i)->callbacks.logger(environment_of(i), (i)->name, (fmi2Status)(status), category, __VA_ARGS__); \
    } while (0)
static const char *first(const char *format, ...) { return format; }

static void pause_ms(int ms) {
    struct timespec pause = {0, ms * 1000000};
    nanosleep(&pause, NULL);
}

static void *talk(void *argument) {
    Instance *i = (Instance *)argument;
    while (!i->ends) {
        LOG(i, fmi2OK, "thread", "a message of another thread");
        pause_ms(1);
    }
    return NULL;
}

static void step_model(Instance *i, double time, double size) {
    double error = i->manner == tolerance_ ? (i->has_tolerance ? i->tolerance : 1e-2) : 0.0;
    i->y += (i->u + 0.5 * i->slope * size) * size * (1.0 + error);
    i->slope = 0.0;
    if (i->manner == libm_) i->y += sin(time) - sin(time); /* `sin` is resolved when it is called. */
    i->time = time + size;
    i->counter++;
}

static void *compute(void *argument) {
    Instance *i = (Instance *)argument;
    pause_ms(2);
    step_model(i, i->time, i->stop);
    i->steps_done = 1;
    return NULL;
}

/* Reads `gain` from a file. In FMI 2.0 the location is a URI, which must be decoded; in FMI 3.0 it is a path. */
static void read_resources(Instance *i, const char *location) {
    char path[4096], *to = path;
    const char *from = location;
    if (!i->is_fmi3) {
        if (strncmp(from, "file:///", 8) != 0) return;
        from += 7;
    }
    for (; *from != 0 && to < path + sizeof path - 32; from++) {
        unsigned code;
        if (!i->is_fmi3 && *from == '%' && sscanf(from + 1, "%2x", &code) == 1) *to++ = (char)code, from += 2;
        else *to++ = *from;
    }
    strcpy(to, "/gain.txt");
    FILE *file = fopen(path, "r");
    if (file == NULL) { LOG(i, fmi2Error, "error", "cannot open the file"); return; }
    if (fscanf(file, "%lf", &i->gain) != 1) i->gain = -1.0;
    fclose(file);
}

static void set_defaults(Instance *i) {
    i->u = i->slope = i->y = 0.0, i->gain = 0.0, i->tolerance = i->stop = 0.0, i->counter = 0, i->valve = 1, i->on = 0;
    i->has_tolerance = i->has_stop = 0;
    i->wide = 0, i->natural = 0, i->size = 3, i->scale = 1.0;
    strcpy(i->label, "none");
    memset(i->vector, 0, sizeof i->vector);
    for (int k = 0; k < 3; k++) i->vector[k] = k + 1.0;
    memcpy(i->bytes, "\x01\x00\xff", 3), i->n_bytes = 3;
}

#ifdef __cplusplus
#include <stdexcept>
static int caught() {
    try {
        throw std::runtime_error("inside");
    } catch (const std::exception &) {
        return 1;
    }
}
extern "C" {
#else
static int caught(void) { return 1; }
#endif

static int manner_of(const char *guid) {
    for (int m = 0; m < COUNT; m++)
        if (strlen(guid) == strlen(NAMES[m]) + 2 && strncmp(guid + 1, NAMES[m], strlen(NAMES[m])) == 0) return m;
    return -1;
}

/* Completes an instance. Frees it and returns NULL if its manner permits only one and there is one already. */
static Instance *begin(Instance *i, int manner, const char *name, const char *resources, void *environment, int logging) {
    i->manner = manner, i->environment = environment, i->logging = logging;
    i->name = strdup(name);
    set_defaults(i);
    if (first_environment == NULL) first_environment = environment;
    if ((manner == once_ && alive > 0) || (manner == null_resources_ && resources != NULL)) {
        LOG(i, fmi2Error, "error", manner == once_ ? "there is an instance already" : "there are no resources");
        free(i->name), free(i);
        return NULL;
    }
    alive++;
    if (manner == resources_) read_resources(i, resources);
    if (manner == directory_ && chdir("/") != 0) abort();
    if (manner == locale_) setlocale(LC_ALL, "C.UTF-8");
    if (manner == rounding_) fesetround(FE_UPWARD), feenableexcept(FE_DIVBYZERO | FE_INVALID);
    if (manner == output_) printf("hello from an FMU\n"), fflush(stdout);
    if (manner == other_environment_ || manner == null_environment_ || manner == freed_environment_)
        LOG(i, fmi2Warning, "greeting", "my environment is not yours");
    if (manner == null_texts_) LOG(i, fmi2Warning, NULL, NULL);
    if (manner == percent_) LOG(i, fmi2Warning, "text", "100% of %20s is %n, 50%");
    if (manner == references_) LOG(i, fmi2Warning, "text", "#r%d# and #i8# of ##%d, #b1#, #r77# and #1", 1, 4);
    if (manner == format_) LOG(i, fmi2Warning, "text", "%s has %d of %ld, %.3f and %5.1e, %-4s|%%|%c", "tank", 7, 8L, 0.5, 1e-9, "ab", 'z');
    if (manner == thread_ || manner == other_thread_) pthread_create(&i->thread, NULL, talk, i);
    return i;
}

static void end(Instance *i) {
    if (i == NULL) return;
    alive--;
    i->ends = 1;
    if (i->manner == thread_ || i->manner == other_thread_) pthread_join(i->thread, NULL);
    if (i->manner == free_) LOG(i, fmi2Warning, "end", "farewell");
    free(i->name);
    if (!i->is_fmi3 && (i->manner == memory_ || i->manner == unchecked_memory_)) i->callbacks.freeMemory(i);
    else free(i);
}

static int setup(Instance *i, int has_tolerance, double tolerance, double start, int has_stop, double stop) {
    i->has_tolerance = has_tolerance, i->tolerance = has_tolerance ? tolerance : -1.0, i->time = start;
    i->has_stop = has_stop, i->stop = has_stop ? stop : -1.0;
    if (i->manner == stop_time_ && !has_stop) {
        LOG(i, fmi2Error, "error", "the stop time is missing");
        return fmi2Error;
    }
    return fmi2OK;
}

static int ok(Instance *i) { return i->manner == warning_ ? fmi2Warning : fmi2OK; }

static int step(Instance *i, double time, double size) {
    if (i->manner == chatty_) LOG(i, fmi2OK, "step", "a step");
    if (i->manner == exceptions_ && !caught()) return fmi2Error;
    if (i->manner == other_environment_) LOG(i, fmi2OK, "step", "a step of a stranger");
    if (i->manner == other_environment_ && time > 0.45) {
        LOG(i, fmi2Error, "error", "the stranger gives up");
        return fmi2Error;
    }
    if (i->manner == discard_ && time > 0.45) {
        LOG(i, fmi2Discard, "error", "the step is too large");
        return fmi2Discard;
    }
    if (i->manner == pending_ && !i->is_fmi3) {
        i->time = time, i->stop = size, i->steps_done = 0;
        pthread_create(&i->thread, NULL, compute, i);
        pthread_detach(i->thread);
        return fmi2Pending;
    }
    step_model(i, time, size);
    return ok(i);
}

static double *real_of(Instance *i, unsigned vr) {
    switch (vr) {
    case U: return &i->u;
    case Y: return &i->y;
    case GAIN: return &i->gain;
    case TOLERANCE: return &i->tolerance;
    case STOP: return &i->stop;
    case SCALE: return &i->scale;
    default: return NULL;
    }
}

/* FMI 2.0. */
const char *fmi2GetTypesPlatform(void) { return "default"; }
const char *fmi2GetVersion(void) { return "2.0"; }

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    int manner = manner_of(guid);
    (void)visible;
    if (type != fmi2CoSimulation || manner < 0) return NULL;
    if (manner == memory_ && (callbacks->allocateMemory == NULL || callbacks->freeMemory == NULL)) {
        callbacks->logger(callbacks->componentEnvironment, name, fmi2Error, "error", "Missing memory callback function");
        return NULL;
    }
    int own = manner == memory_ || manner == unchecked_memory_;
    Instance *i = (Instance *)(own ? callbacks->allocateMemory(1, sizeof(Instance)) : calloc(1, sizeof(Instance)));
    i->callbacks = *callbacks;
    return begin(i, manner, name, resources, callbacks->componentEnvironment, logging);
}

void fmi2FreeInstance(fmi2Component c) { end((Instance *)c); }

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                               fmi2Boolean has_stop, fmi2Real stop) {
    return (fmi2Status)setup((Instance *)c, has_tolerance, tolerance, start, has_stop, stop);
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return (fmi2Status)ok((Instance *)c); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (fmi2Status)ok((Instance *)c); }
fmi2Status fmi2Terminate(fmi2Component c) { return (fmi2Status)ok((Instance *)c); }

fmi2Status fmi2Reset(fmi2Component c) {
    Instance *i = (Instance *)c;
    if (i->manner == no_reset_) return fmi2Error;
    set_defaults(i);
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t k = 0; k < n; k++) *real_of((Instance *)c, vr[k]) = value[k];
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    Instance *i = (Instance *)c;
    for (size_t k = 0; k < n; k++) value[k] = vr[k] == Y ? i->y + i->gain : *real_of(i, vr[k]);
    return (fmi2Status)ok(i);
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer value[]) {
    for (size_t k = 0; k < n; k++) *(vr[k] == VALVE ? &((Instance *)c)->valve : &((Instance *)c)->counter) = value[k];
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer value[]) {
    for (size_t k = 0; k < n; k++) value[k] = vr[k] == VALVE ? ((Instance *)c)->valve : ((Instance *)c)->counter;
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) ((Instance *)c)->on = value[k];
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->on;
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) strncpy(((Instance *)c)->label, value[k], 63);
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    (void)vr;
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->label;
    return (fmi2Status)ok((Instance *)c);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    (void)vr, (void)order;
    if (n > 0) ((Instance *)c)->slope = value[0];
    return fmi2OK;
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real size, fmi2Boolean no_set_state) {
    (void)no_set_state;
    return (fmi2Status)step((Instance *)c, time, size);
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Status *value) {
    if (kind != fmi2DoStepStatus) return fmi2Discard;
    *value = ((Instance *)c)->steps_done ? fmi2OK : fmi2Pending;
    return fmi2OK;
}

/* In both FMI versions, a state is a copy of the instance. */
static int get_state(Instance *i, void **state) {
    if (*state == NULL) *state = malloc(sizeof *i);
    memcpy(*state, i, sizeof *i);
    return fmi2OK;
}

static int set_state(Instance *i, void *state) {
    Instance *from = (Instance *)state;
    i->u = from->u, i->y = from->y, i->gain = from->gain, i->counter = from->counter, i->time = from->time;
    return fmi2OK;
}

static int state_size(Instance *i, size_t *size) {
    *size = i->manner == huge_state_ ? (size_t)1 << 46 : i->manner == endless_state_ ? SIZE_MAX : sizeof *i;
    if (i->manner == growing_state_) *size += (size_t)++i->counter;
    return fmi2OK;
}

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state) { return (fmi2Status)get_state((Instance *)c, state); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) { return (fmi2Status)set_state((Instance *)c, state); }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state) {
    (void)c;
    free(*state), *state = NULL;
    return fmi2OK;
}
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    (void)state;
    return (fmi2Status)state_size((Instance *)c, size);
}
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size) {
    (void)c;
    if (size < sizeof(Instance)) return fmi2Error;
    memcpy(bytes, state, sizeof(Instance));
    return fmi2OK;
}
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state) {
    (void)c;
    if (size < sizeof(Instance)) return fmi2Error;
    *state = malloc(sizeof(Instance));
    memcpy(*state, bytes, sizeof(Instance));
    return fmi2OK;
}

#ifndef FMI2_ONLY
/* FMI 3.0. */
const char *fmi3GetVersion(void) { return "3.0"; }

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
                                         fmi3Boolean logging, fmi3Boolean events, fmi3Boolean early,
                                         const fmi3ValueReference required[], size_t n, fmi3InstanceEnvironment environment,
                                         fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update) {
    int manner = manner_of(token);
    (void)visible, (void)events, (void)early, (void)required, (void)n, (void)update;
    if (manner < 0) return NULL;
    Instance *i = (Instance *)calloc(1, sizeof *i);
    i->is_fmi3 = 1, i->log3 = log;
    return begin(i, manner, name, resources, environment, logging);
}

void fmi3FreeInstance(fmi3Instance c) { end((Instance *)c); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean has_stop, fmi3Float64 stop) {
    return (fmi3Status)setup((Instance *)c, has_tolerance, tolerance, start, has_stop, stop);
}
fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (fmi3Status)ok((Instance *)c); }
fmi3Status fmi3Terminate(fmi3Instance c) { return (fmi3Status)ok((Instance *)c); }
fmi3Status fmi3Reset(fmi3Instance c) { return (fmi3Status)fmi2Reset(c); }

fmi3Status fmi3EnterConfigurationMode(fmi3Instance c) {
    ((Instance *)c)->configuring = 1;
    return fmi3OK;
}
fmi3Status fmi3ExitConfigurationMode(fmi3Instance c) {
    Instance *i = (Instance *)c;
    if (!i->configuring) return fmi3Error;
    i->configuring = 0;
    for (size_t k = 0; k < i->size; k++) i->vector[k] = (double)k + 1.0;
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Float64 value[], size_t n_value) {
    Instance *i = (Instance *)c;
    const fmi3Float64 *from = value;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] == VECTOR) {
            if ((size_t)(from - value) + i->size > n_value) return fmi3Error;
            memcpy(i->vector, from, i->size * sizeof *from), from += i->size;
        } else if (vr[k] == SCALE && !i->configuring) return fmi3Error;
        else *real_of(i, vr[k]) = *from++;
    }
    return (size_t)(from - value) == n_value ? (fmi3Status)ok(i) : fmi3Error;
}
fmi3Status fmi3GetFloat64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Float64 value[], size_t n_value) {
    Instance *i = (Instance *)c;
    fmi3Float64 *to = value;
    for (size_t k = 0; k < n; k++) {
        double sum = 0.0;
        for (size_t j = 0; j < i->size; j++) sum += i->vector[j];
        if (vr[k] == VECTOR) memcpy(to, i->vector, i->size * sizeof *to), to += i->size;
        else *to++ = vr[k] == SUM ? i->scale * sum : vr[k] == Y ? i->y + i->gain : *real_of(i, vr[k]);
    }
    return (size_t)(to - value) == n_value ? (fmi3Status)ok(i) : fmi3Error;
}
fmi3Status fmi3SetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int32 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2SetInteger(c, vr, n, (const fmi2Integer *)value);
}
fmi3Status fmi3GetInt32(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int32 value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2GetInteger(c, vr, n, (fmi2Integer *)value);
}
fmi3Status fmi3SetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3Int64 value[], size_t n_value) {
    (void)vr, (void)n_value;
    for (size_t k = 0; k < n; k++) ((Instance *)c)->wide = value[k];
    return fmi3OK;
}
fmi3Status fmi3GetInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3Int64 value[], size_t n_value) {
    (void)vr, (void)n_value;
    for (size_t k = 0; k < n; k++) value[k] = ((Instance *)c)->wide;
    return fmi3OK;
}
fmi3Status fmi3SetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3UInt64 value[], size_t n_value) {
    Instance *i = (Instance *)c;
    (void)n_value;
    for (size_t k = 0; k < n; k++) {
        /* A fixed structural parameter can be set only in Configuration Mode (sections 2.3.2 and 2.3.3). */
        if (vr[k] == SIZE && (!i->configuring || value[k] > 8)) return fmi3Error;
        *(vr[k] == SIZE ? &i->size : &i->natural) = value[k];
    }
    return fmi3OK;
}
fmi3Status fmi3GetUInt64(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3UInt64 value[], size_t n_value) {
    (void)n_value;
    for (size_t k = 0; k < n; k++) value[k] = vr[k] == SIZE ? ((Instance *)c)->size : ((Instance *)c)->natural;
    return fmi3OK;
}
fmi3Status fmi3SetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const fmi3String value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2SetString(c, vr, n, value);
}
fmi3Status fmi3GetString(fmi3Instance c, const fmi3ValueReference vr[], size_t n, fmi3String value[], size_t n_value) {
    (void)n_value;
    return (fmi3Status)fmi2GetString(c, vr, n, value);
}
fmi3Status fmi3SetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, const size_t sizes[],
                         const fmi3Binary value[], size_t n_value) {
    Instance *i = (Instance *)c;
    (void)vr, (void)n, (void)n_value;
    if (sizes[0] > sizeof i->bytes) {
        LOG(i, fmi2Error, "error", "too many bytes");
        return fmi3Error;
    }
    memcpy(i->bytes, value[0], sizes[0]), i->n_bytes = sizes[0];
    return fmi3OK;
}
fmi3Status fmi3GetBinary(fmi3Instance c, const fmi3ValueReference vr[], size_t n, size_t sizes[], fmi3Binary value[],
                         size_t n_value) {
    (void)vr, (void)n, (void)n_value;
    sizes[0] = ((Instance *)c)->manner == huge_bytes_ ? SIZE_MAX : ((Instance *)c)->n_bytes, value[0] = ((Instance *)c)->bytes;
    return fmi3OK;
}
fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 time, fmi3Float64 size, fmi3Boolean no_set_state, fmi3Boolean *event,
                      fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached) {
    (void)no_set_state;
    *event = *terminate = *early = fmi3False, *reached = time + size;
    return (fmi3Status)step((Instance *)c, time, size);
}
fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)get_state((Instance *)c, state); }
fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state) { return (fmi3Status)set_state((Instance *)c, state); }
fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state) { return (fmi3Status)fmi2FreeFMUstate(c, state); }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c, fmi3FMUState state, size_t *size) {
    return (fmi3Status)fmi2SerializedFMUstateSize(c, state, size);
}
fmi3Status fmi3SerializeFMUState(fmi3Instance c, fmi3FMUState state, fmi3Byte bytes[], size_t size) {
    return (fmi3Status)fmi2SerializeFMUstate(c, state, (fmi2Byte *)bytes, size);
}
fmi3Status fmi3DeserializeFMUState(fmi3Instance c, const fmi3Byte bytes[], size_t size, fmi3FMUState *state) {
    return (fmi3Status)fmi2DeSerializeFMUstate(c, (const fmi2Byte *)bytes, size, state);
}
#endif

#ifdef __cplusplus
}
#endif
