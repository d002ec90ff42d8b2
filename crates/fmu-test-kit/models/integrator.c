/* An integrator for Co-Simulation that behaves like FMUs of other producers, or misbehaves: y' = factor * u + bias. It is compiled
   without -lm, as C and as C++. Its guid lists the traits, as in "{chatty,no_reset}", and after a colon a file, to which the FMU writes a
   character for each new instance (+), reset (r) and freed instance (-).

   Traits of this file and of the frame, most of them with tools in which they were observed:
     memory             needs the memory callbacks: OpenModelica 1.12 to 1.24, 20-sim
     unchecked_memory   calls the memory callbacks without checking for NULL: HIFSuite, Vector
     other_environment  passes its own pointer to the logger: UniFMU, Overture
     null_environment   passes NULL to the logger: wrappers that copy only the functions
     freed_environment  passes the environment of an earlier instance: libraries with a global callback struct
     thread             logs from its own thread: UniFMU and other FMUs that connect to a server
     other_thread       logs from its own thread and passes its own pointer: UniFMU
     free               logs while it is freed: OpenModelica
     format             passes a printf format with arguments to the logger: OpenModelica, FMU SDK
     percent            logs text that contains percent signs, without arguments: Reference FMUs with paths of resources
     references         logs text that refers to variables, as section 2.1.5 of FMI 2.0 describes
     null_resources     accepts only NULL as the location of its resources, because it has none
     chatty             logs each step: OpenModelica
     null_texts         passes NULL as category and message
     resources          reads a file of its resources by URI: Dymola, OpenModelica
     tolerance          has a solver that uses the tolerance of the experiment: Dymola
     stop_time          needs a stop time: exports of tools with a fixed simulation interval
     pending            performs steps of FMI 2.0 in a thread and returns fmi2Pending: FMUs that run asynchronously
     equal_steps        rejects a step whose size differs from the first one in any bit: controllers with a fixed sample time
     warning            returns a warning from every call that reads or sets values or makes a step: Hopsan
     discard            returns fmi2Discard from t = 0.5 on: Dymola at an event that it cannot handle
     once               allows only one instance per process: JModelica, 20-sim
     directory          changes the working directory: tools that read tables by relative paths
     locale             changes the locale: exports with a GUI toolkit
     rounding           changes the rounding mode and unmasks floating-point exceptions: Fortran runtimes, Altair
     output             prints to stdout: Hopsan, PythonFMU
     libm               uses libm but is not linked to it: many C exports
     exceptions         throws and catches C++ exceptions: JModelica, CATIA, HIFSuite
     no_reset           returns an error from reset: many tools
     huge_bytes         reports SIZE_MAX bytes as the size of a binary value
     huge_state         reports a serialized state of 2^46 bytes
     endless_state      reports a serialized state of SIZE_MAX bytes
     growing_state      reports a larger size of the serialized state with each call
     free_state_fails   returns an error when a saved state is freed
     keeps_y, keeps_bias  values that survive a reset
     derived            calculates the gain from the parameter only once, so that the first gain survives a reset
     misbehaving        has another output, and the parameter `behaviour` selects how a run ends (BEHAVIOURS)
     unknown, mute      makes no instance; the first one logs why, if logging is on */
#include "frame.h"
#include <fcntl.h>
#include <fenv.h>
#include <pthread.h>
#include <time.h>

enum {
    U = 1, Y, GAIN, TOLERANCE, STOP, LABEL, ECHO, COUNTER, WIDE, WIDE_OUT, BINARY, BINARY_OUT, SIZE, VECTOR, SUM, VALVE, NATURAL, SCALE,
    FACTOR, BIAS, FAILS, GAP, BEHAVIOUR, COUNT, FLAG, INSTANCES, LOGGED
};
/* How a run ends, from 0.5 s on. */
enum BEHAVIOURS {
    GOOD, SILENT_ERROR, IS_PENDING, FATAL_ERROR, DISCARDED, NO_STATUS, NO_RESET, IS_WARNING, ENDS_BETWEEN, ENDS_AT_POINT, NO_TERMINATE,
    NO_START, ERROR_IF_LOGGING, FATAL_IF_LOGGING, SLOW_IF_LOGGING, RETURNS_EARLY
};

struct Model {
    Fmu fmu;
    double y, u, slope, offset, scale, factor, bias, gain, fails, vector[8];
    int32_t counter, valve, behaviour, count, flag;
    int64_t wide;
    uint64_t natural, size;
    char label[64];
    unsigned char bytes[64];
    size_t n_bytes;
    /* Kept by a reset and by restored states. */
    int file, ends;
    double step_size, no_value;
    double first_size;
    pthread_t thread;
};

/* The number of instances now, the largest number until now, and the number of steps with logging on. */
static int alive, most, logged_steps;

static void pause_ms(double ms) {
    struct timespec pause = {0, (long)(ms * 1e6)};
    nanosleep(&pause, NULL);
}

static void record(const Model *m, const char *character) { if (m->file && write(m->file, character, 1) != 1) abort(); }

#ifdef __cplusplus
#include <stdexcept>
static bool caught() {
    try { throw std::runtime_error("inside"); } catch (const std::exception &) { return true; }
}
#else
static bool caught(void) { return true; }
#endif

static void *talk(void *argument) {
    Model *m = (Model *)argument;
    for (; !__atomic_load_n(&m->ends, __ATOMIC_ACQUIRE); pause_ms(1)) LOG(&m->fmu, OK, "thread", "a message of another thread");
    return NULL;
}

static void set_start(Model *m) {
    m->factor = m->scale = 1, m->fails = -1, m->valve = 1, m->size = m->n_bytes = m->count = 3;
    m->u = IS(misbehaving);
    strcpy(m->label, "none");
    for (int k = 0; k < 3; k++) m->vector[k] = k + 1.0;
    memcpy(m->bytes, "\x01\x00\xff", 3);
}

static int begin(Model *m, const char *token, const char *resources) {
    Fmu *f = &m->fmu;
    const char *file = strchr(token, ':');
    if (!f->cs || IS(mute) || (IS(unknown) && !f->logging)) return ERROR;
    if (IS(unknown) || (IS(once) && alive > 0) || (IS(null_resources) && resources)) {
        LOG(f, ERROR, "error", IS(unknown) ? "the guid is of another FMU" : IS(once) ? "there is an instance already" : "there are no resources");
        return ERROR;
    }
    if (++alive > most) most = alive;
    if (file) {
        char path[4096];
        snprintf(path, sizeof path, "%.*s", (int)strcspn(file + 1, "}"), file + 1);
        m->file = open(path, O_WRONLY | O_CREAT | O_APPEND, 0600);
        record(m, "+");
    }
    if (IS(resources)) m->step_size = read_resource(f->fmi == 2, resources, "gain.txt");
    m->offset = m->step_size;
    if (IS(directory) && chdir("/") != 0) abort();
    if (IS(locale)) setlocale(LC_ALL, "C.UTF-8");
    if (IS(rounding)) fesetround(FE_UPWARD), feenableexcept(FE_DIVBYZERO | FE_INVALID);
    if (IS(output)) printf("hello from an FMU\n"), fflush(stdout);
    if (IS(other_environment) || IS(null_environment) || IS(freed_environment))
        LOG(f, WARNING, "greeting", "my environment is not yours");
    if (IS(misbehaving)) LOG(f, OK, "logAll", "here I am");
    if (IS(null_texts)) LOG(f, WARNING, NULL, NULL);
    if (IS(percent)) LOG(f, WARNING, "text", "100% of %20s is %n, 50%");
    if (IS(references)) LOG(f, WARNING, "text", "#r%d# and #i8# of ##%d, #b1#, #r77# and #1", 1, 4);
    if (IS(format)) LOG(f, WARNING, "text", "%s has %d of %ld, %.3f and %5.1e, %-4s|%%|%c", "tank", 7, 8L, 0.5, 1e-9, "ab", 'z');
    if (IS(thread) || IS(other_thread)) pthread_create(&m->thread, NULL, talk, m);
    return OK;
}

static void end(Model *m) {
    alive--;
    __atomic_store_n(&m->ends, 1, __ATOMIC_RELEASE);
    if (IS(thread) || IS(other_thread)) pthread_join(m->thread, NULL);
    if (IS(free)) LOG(&m->fmu, WARNING, "end", "farewell");
    record(m, "-");
    if (m->file) close(m->file);
}

static bool array(Place *to, Kind kind, void *data, int settable, size_t count) { return at(to, kind, data, settable), to->count = count, true; }

static bool place(Model *m, Kind kind, uint32_t vr, Place *to) {
    Fmu *f = &m->fmu;
    double sum = 0;
    (void)kind;
    switch (vr) {
    case U: return at_real(to, &m->u, INPUT);
    case Y: return calculated(f, to, m->y + m->offset + (IS(misbehaving) ? (double)strlen(m->label) : 0));
    case GAIN: return at_real(to, &m->offset, INPUT);
    case TOLERANCE: return calculated(f, to, f->tolerance);
    case STOP: return calculated(f, to, f->stop > DBL_MAX ? -1 : f->stop);
    case LABEL: return array(to, TEXT, m->label, INPUT, sizeof m->label);
    case ECHO: return array(to, TEXT, m->label, 0, sizeof m->label);
    case COUNTER: return at(to, INTEGER, &m->counter, 0);
    case WIDE: return at(to, LONG, &m->wide, INPUT);
    case WIDE_OUT: return at(to, LONG, &m->wide, 0);
    case BINARY: return array(to, BYTES, m->bytes, INPUT, m->n_bytes);
    case BINARY_OUT: return array(to, BYTES, m->bytes, 0, IS(huge_bytes) ? SIZE_MAX : m->n_bytes);
    /* A fixed structural parameter can be set only in Configuration Mode (sections 2.3.2 and 2.3.3 of FMI 3.0). */
    case SIZE: return at(to, NATURAL_LONG, &m->size, CONFIGURATION), to->high = 8, true;
    case SCALE: return at_real(to, &m->scale, CONFIGURATION);
    case VECTOR: return array(to, REAL, m->vector, INPUT, m->size);
    case SUM:
        for (size_t j = 0; j < m->size; j++) sum += m->vector[j];
        return calculated(f, to, m->scale * sum);
    case VALVE: return at(to, INTEGER, &m->valve, INPUT);
    case NATURAL: return at(to, NATURAL_LONG, &m->natural, INPUT);
    case FACTOR: return at_real(to, &m->factor, FIXED);
    case BIAS: return at_real(to, &m->bias, FIXED);
    case FAILS: return at_real(to, &m->fails, FIXED);
    case GAP: return at_real(to, &m->no_value, 0);
    case BEHAVIOUR: return at(to, INTEGER, &m->behaviour, FIXED);
    case COUNT: return at(to, INTEGER, &m->count, INPUT);
    case FLAG: return at(to, BOOLEAN, &m->flag, INPUT);
    case INSTANCES: return counted(f, to, INTEGER, most);
    case LOGGED: return counted(f, to, INTEGER, logged_steps);
    default: return false;
    }
}

static bool take(Model *m, uint32_t vr, const void *value) {
    if (vr == BINARY) m->n_bytes = *(const size_t *)value;
    return true;
}

static int enters(Model *m, int mode) {
    Fmu *f = &m->fmu;
    if (mode == CONFIGURATION) for (size_t k = 0; k < m->size; k++) m->vector[k] = (double)k + 1.0;
    if (mode == START) record(m, "r");
    if (mode == START && (IS(no_reset) || m->behaviour == NO_RESET)) return ERROR;
    if (mode == ENDED && m->behaviour == NO_TERMINATE) return f->fmi == 3 ? FATAL : ERROR;
    if (mode == INITIALIZATION && IS(stop_time) && f->stop > DBL_MAX) { LOG(f, ERROR, "error", "the stop time is missing"); return ERROR; }
    if (mode == STEP && m->behaviour == NO_START) return ERROR;
    if (mode == STEP && (!IS(derived) || m->gain == 0)) m->gain = m->factor;
    return IS(warning) ? WARNING : OK;
}

/* Advances to a time. */
static void advance(Model *m, double from, double to) {
    Fmu *f = &m->fmu;
    double size = to - from, error = IS(tolerance) ? f->tolerance >= 0 ? f->tolerance : 1e-2 : 0;
    m->y += size * (m->gain * (m->u + 0.5 * m->slope * size) + m->bias) * (1 + error);
    m->slope = 0;
    if (IS(libm)) m->y += sin(from) - sin(from); /* `sin` is resolved when it is called. */
    f->time = to;
}

static void *compute(void *argument) {
    Model *m = (Model *)argument;
    pause_ms(2);
    advance(m, m->fmu.time, m->fmu.time + m->step_size);
    m->counter++;
    __atomic_store_n(&m->fmu.asynchronous, 2, __ATOMIC_RELEASE);
    return NULL;
}

/* Ends a step of an FMU that misbehaves from 0.5 s on. */
static int misbehave(Model *m, bool late) {
    Fmu *f = &m->fmu;
    if (!late && m->behaviour == IS_PENDING) { LOG(f, WARNING, "logAll", "not the reason"); return WARNING; }
    f->ended = late && (m->behaviour == ENDS_BETWEEN || m->behaviour == ENDS_AT_POINT);
    if (!late) return OK;
    switch (m->behaviour) {
    case SILENT_ERROR: case ERROR_IF_LOGGING: case SLOW_IF_LOGGING: return ERROR;
    case IS_PENDING: return PENDING;
    case FATAL_ERROR: case FATAL_IF_LOGGING: return FATAL;
    case NO_STATUS: return 77;
    case IS_WARNING: LOG(f, WARNING, "logAll", "a warning"); return WARNING;
    case DISCARDED: LOG(f, DISCARD, "logAll", "no more of this after %s", "half"); return DISCARD;
    case ENDS_BETWEEN:
        LOG(f, f->fmi == 2 ? DISCARD : OK, "logAll", "the tank is empty");
        return f->fmi == 2 ? DISCARD : OK;
    case ENDS_AT_POINT: return f->fmi == 2 ? DISCARD : OK;
    default: return OK;
    }
}

static int step(Model *m, double point, double size) {
    Fmu *f = &m->fmu;
    bool late = point > 0.45;
    if (IS(chatty)) LOG(f, OK, "step", "a step");
    if (IS(exceptions) && !caught()) return ERROR;
    if (IS(other_environment)) LOG(f, OK, "step", "a step of a stranger");
    if (IS(other_environment) && late) { LOG(f, ERROR, "error", "the stranger gives up"); return ERROR; }
    if (IS(discard) && late) { LOG(f, DISCARD, "error", "the step is too large"); return DISCARD; }
    if (f->steps == (int)m->fails) return ERROR;
    if (f->steps == 0) m->first_size = size;
    if (IS(equal_steps) && size != m->first_size) { LOG(f, ERROR, "error", "the step has another size"); return ERROR; }
    if (IS(pending) && f->fmi == 2) {
        m->step_size = size, f->asynchronous = 1;
        pthread_create(&m->thread, NULL, compute, m);
        pthread_detach(m->thread);
        return PENDING;
    }
    logged_steps += f->logging;
    if (f->logging && m->behaviour >= ERROR_IF_LOGGING && m->behaviour <= SLOW_IF_LOGGING)
        LOG(f, late ? OK : ERROR, "logAll", late ? "the pump ran dry" : "not the reason");
    if (f->logging && m->behaviour == SLOW_IF_LOGGING) pause_ms(300);
    f->returned_early = late && (m->behaviour == RETURNS_EARLY || m->behaviour == ENDS_BETWEEN);
    if (f->returned_early) f->last = point + 0.25 * size;
    advance(m, point, f->last);
    m->counter++;
    return IS(warning) ? WARNING : misbehave(m, late);
}

static void set_slope(Model *m, double value) { m->slope = value; }

static size_t serialized(Model *m, size_t size) {
    if (IS(growing_state)) return size + (size_t)++m->counter;
    return IS(huge_state) ? (size_t)1 << 46 : IS(endless_state) ? SIZE_MAX : size;
}

static void copy(Model *m, Model *copy, Copying why) {
    if (why != RESETTING) return;
    if (IS(keeps_y)) m->y = copy->y;
    if (IS(keeps_bias)) m->bias = copy->bias;
    if (IS(derived)) m->gain = copy->gain;
}

static bool plausible(const Model *copy) { return copy->size <= 8 && copy->n_bytes <= 64 && memchr(copy->label, 0, 64); }

const Behaviour behaviour = {
    .size = sizeof(Model), .saved = offsetof(Model, file), .state = offsetof(Model, y), .configurable = true, .begin = begin, .end = end,
    .start = set_start, .place = place, .take = take, .enter = enters, .step = step, .copy = copy, .plausible = plausible,
    .slope = set_slope, .serialized = serialized,
};
