/* The FMI 2.0 functions of a model that was compiled to WebAssembly and translated to C.

   Each instance is one block of memory with its own copy of the module. The module has functions with the same names as
   FMI, which accept or reject each call and write the log. The functions here copy the importer's arrays and strings
   into the module's memory and results out of it, and they report traps to the module. */

/* Defines the name of the module and the size of its memory. */
#include "module.h"

#if !defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
#define FMI2_FUNCTION_PREFIX FMU_PREFIX
#endif
#include "fmi2Functions.h"
#include <stdlib.h>

typedef struct {
    FMU_MODULE module;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    char *name;
    u32 component; /* the instance in the module */
    u32 buffer;    /* address of the module's memory for arguments */
    u32 buffer_size;
    bool dead; /* whether a call has trapped and the module could not report that */
} Instance;

/* A running call. */
typedef struct {
    Instance *instance;
    const char *function;
    jmp_buf trap;
    volatile u32 stack; /* stack pointer before the call; set after setjmp, read after longjmp (C99 7.13.2.1) */
    u32 next;  /* address of the next argument */
    bool endless; /* whether an array is longer than any array can be */
} Call;

static void log_error(const Instance *instance, fmi2Status status, fmi2String message) {
    if (instance->logger != NULL) {
        instance->logger(instance->environment, instance->name, status,
                         status == fmi2Fatal ? "logStatusFatal" : "logStatusError", message);
    }
}

/* Passes a message of the module to the importer. */
void FMU_log(struct w2c_fmu *importer, u32 status, u32 category, u32 message) {
    const Instance *instance = (const Instance *)(void *)importer;
    const char *texts = (const char *)instance->module.w2c_memory.data.bytes;
    if (instance->logger != NULL) {
        instance->logger(instance->environment, instance->name, (fmi2Status)status, texts + category,
                         texts + message);
    }
}

static void begin(Call *call, Instance *instance, const char *function) {
    call->instance = instance;
    call->function = function;
    call->stack = instance->module.FMU_STACK;
    call->next = instance->buffer;
    call->endless = false;
    instance->module.w2c_memory.trap = &call->trap;
    instance->module.w2c_memory.is_full = false;
}

static fmi2Status end(Call *call, fmi2Status status) {
    call->instance->module.w2c_memory.trap = NULL;
    return status;
}

/* Returns the length of an array as the module receives it. */
static u32 count(const Call *call, size_t n) {
    return call->endless ? UINT32_MAX : (u32)n;
}

/* Returns whether `n` times `each` bytes fit in the memory of an instance. If not, the importer's values must not be accessed,
   because `n` may be wrong. */
static inline bool fits(size_t n, size_t each) {
    return n <= FMU_MEMORY / each;
}

/* Allocates `n` times `each` bytes for arguments, and `more` bytes for gaps and other arguments. Returns false if the
   memory is used up. If no array can have the length `n`, allocates nothing for it, because the module rejects it. */
static inline bool reserve(Call *call, size_t n, size_t each, size_t more) {
    Instance *instance = call->instance;
    size_t size;
    if (n > PTRDIFF_MAX / 8) {
        call->endless = true;
        n = 0;
    }
    if (!fits(n, each) || more >= UINT32_MAX / 4) {
        return false;
    }
    size = n * each + more;
    if (size > instance->buffer_size) {
        instance->buffer_size = 0;
        instance->buffer = FMU_argument_buffer(&instance->module, (u32)size);
        if (instance->buffer == 0) {
            return false;
        }
        instance->buffer_size = (u32)size;
        call->next = instance->buffer;
    }
    return true;
}

static fmi2Status reject(Call *call, fmi2String message) {
    log_error(call->instance, fmi2Error, message);
    return end(call, fmi2Error);
}

/* The alignment of types on this machine. */
#define ALIGNED(type) \
    typedef struct {  \
        char byte;    \
        type value;   \
    } Aligned_##type;
ALIGNED(fmi2Real)
ALIGNED(fmi2Integer)
ALIGNED(fmi2Boolean)
ALIGNED(fmi2String)
ALIGNED(fmi2Byte)
ALIGNED(fmi2ValueReference)
ALIGNED(fmi2Status)
ALIGNED(fmi2FMUstate)
ALIGNED(fmi2EventInfo)
ALIGNED(size_t)
#define ALIGNMENT(type) offsetof(Aligned_##type, value)

/* Returns the address in the module for an array of the importer: 0 for NULL, and an unaligned address for an unaligned
   array, so that the module can check both. */
static inline u32 output(Call *call, const void *array, size_t n, size_t size, size_t alignment) {
    u32 address = call->next;
    if (array == NULL) {
        return 0;
    }
    if (((uintptr_t)array & (alignment - 1)) != 0) {
        return address + 1;
    }
    if (!call->endless) {
        call->next += (u32)((n * size + 7) / 8 * 8);
    }
    return address;
}

static void *at(const Call *call, u32 address) {
    return call->instance->module.w2c_memory.data.bytes + address;
}

static inline u32 input(Call *call, const void *array, size_t n, size_t size, size_t alignment) {
    u32 address = output(call, array, n, size, alignment);
    if ((address & (alignment - 1)) == 0 && address != 0 && !call->endless) {
        memcpy(at(call, address), array, n * size);
    }
    return address;
}

#define IN(array, n, type) input(&call, array, n, sizeof(type), ALIGNMENT(type))
#define OUT(array, n, type) output(&call, array, n, sizeof(type), ALIGNMENT(type))
#define COPY_OUT(array, address, n)                               \
    if (status == fmi2OK && (n) != 0) {                           \
        memcpy(array, at(&call, address), (n) * sizeof *(array)); \
    }

static size_t length(fmi2String text) {
    return text == NULL ? 0 : strlen(text) + 1;
}

static u32 string(Call *call, fmi2String text) {
    return input(call, text, length(text), 1, 1);
}

/* Copies the importer's strings into the module. Returns the address of an array of their addresses; 0 for
   NULL. */
static u32 strings(Call *call, const fmi2String texts[], size_t n) {
    u32 array = output(call, texts, n, sizeof(u32), ALIGNMENT(fmi2String));
    size_t i;
    if (array % sizeof(u32) == 0 && array != 0 && !call->endless) {
        for (i = 0; i < n; i++) {
            u32 text = string(call, texts[i]);
            memcpy(at(call, array + (u32)(i * sizeof text)), &text, sizeof text);
        }
    }
    return array;
}

static size_t length_of_all(const fmi2String texts[], size_t n) {
    size_t i, sum = 0;
    if (texts == NULL || (uintptr_t)texts % ALIGNMENT(fmi2String) != 0 || !fits(n, sizeof(u32))) {
        return 0;
    }
    for (i = 0; i < n; i++) {
        sum += length(texts[i]) + 8;
    }
    return sum;
}

static const char *reason(const wasm_rt_memory_t *memory) {
    if (memory->is_full) {
        return "the memory of the instance is used up; compile the FMU with a larger FMU_MEMORY_PAGES";
    }
    return memory->reason == WASM_RT_TRAP_OOB ? "stack overflow" : "no message";
}

/* Ends a call that has trapped. The module logs the reason and returns the status; if that traps, too, the instance
   cannot be used any more. */
static fmi2Status broken(Call *call) {
    Instance *instance = call->instance;
    instance->module.FMU_STACK = call->stack;
    if (setjmp(call->trap) == 0) {
        const char *why = reason(&instance->module.w2c_memory);
        if (reserve(call, length(call->function) + length(why), 1, 16)) {
            u32 function, text;
            call->next = instance->buffer;
            call->endless = false;
            function = string(call, call->function);
            text = string(call, why);
            return end(call, (fmi2Status)FMU_broken(&instance->module, instance->component, function, text));
        }
    }
    instance->dead = true;
    log_error(instance, fmi2Fatal, "internal failure; free this instance, others are not affected");
    return end(call, fmi2Fatal);
}

/* Begins a function of an instance. Rejects a call during another call, which the log callback could make. */
#define BEGIN(name)                                                     \
    Instance *instance = (Instance *)c;                                 \
    fmi2Status status;                                                  \
    Call call;                                                          \
    if (instance == NULL || instance->module.w2c_memory.trap != NULL) { \
        return fmi2Error;                                               \
    }                                                                   \
    if (instance->dead) {                                               \
        return fmi2Fatal;                                               \
    }                                                                   \
    begin(&call, instance, name);                                       \
    if (setjmp(call.trap) != 0) {                                       \
        return broken(&call);                                           \
    }

#define RESERVE(name, n, each, more)                                                              \
    if (!reserve(&call, n, each, more)) {                                                         \
        return reject(&call, name ": the instance has no memory for so many values; compile the " \
                                  "FMU with a larger FMU_MEMORY_PAGES");                          \
    }

/* Calls a function of the module. Its first FMI argument is the instance in the module. */
#define CALL(function, ...) status = (fmi2Status)function(&instance->module, instance->component, __VA_ARGS__)
#define END return end(&call, status);

fmi2String fmi2GetTypesPlatform(void) {
    return fmi2TypesPlatform;
}

fmi2String fmi2GetVersion(void) {
    return fmi2Version;
}

/* fmi2CallbackFunctions as the module reads it: it only checks whether there is a logger. */
typedef struct {
    u32 logger, allocate_memory, free_memory, step_finished, environment;
} Callbacks;

/* Allocates all memory of an instance. */
static Instance *allocate(fmi2String name, const fmi2CallbackFunctions *functions) {
    Instance *instance = (Instance *)calloc(1, sizeof(Instance) + length(name) + 1);
    if (instance == NULL) {
        if (functions->logger != NULL) {
            functions->logger(functions->componentEnvironment, name, fmi2Error, "logStatusError",
                              "fmi2Instantiate: there is no memory for an instance");
        }
        return NULL;
    }
    instance->logger = functions->logger;
    instance->environment = functions->componentEnvironment;
    instance->name = (char *)(instance + 1);
    if (name != NULL) {
        memcpy(instance->name, name, length(name));
    }
    return instance;
}

/* Initializes the module and creates the instance in it. Returns false if the module rejects the arguments. */
static bool make(Instance *instance, fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                 fmi2Boolean visible, fmi2Boolean logging_on) {
    Call call;
    begin(&call, instance, "fmi2Instantiate");
    if (setjmp(call.trap) != 0) {
        broken(&call);
        return false;
    }
    FMU_instantiate(&instance->module, (struct w2c_fmu *)(void *)instance);
    call.stack = instance->module.FMU_STACK;
    if (reserve(&call, length(name) + length(guid) + length(resources), 1, 4096)) {
        Callbacks callbacks = {0, 0, 0, 0, 0};
        u32 in_name = string(&call, name), in_guid = string(&call, guid), in_resources = string(&call, resources);
        callbacks.logger = instance->logger != NULL;
        instance->component = FMU_fmi2Instantiate(&instance->module, in_name, (u32)type, in_guid, in_resources,
                                                  input(&call, &callbacks, 1, sizeof callbacks, 1), (u32)visible,
                                                  (u32)logging_on);
    } else {
        log_error(instance, fmi2Error, "fmi2Instantiate: the arguments need more memory than an instance has");
    }
    end(&call, fmi2OK);
    return instance->component != 0;
}

/* Whether the compiler fuses products and sums. The runtime forbids it, but compiler options can override that. */
static bool fuses(void) {
    volatile double factor = 1 + DBL_EPSILON;
    double product = factor * factor;
    return product - (1 + 2 * DBL_EPSILON) != 0;
}

fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging_on) {
    Instance *instance = functions == NULL ? NULL : allocate(name, functions);
    if (instance == NULL) {
        return NULL;
    }
    if (fuses()) {
        log_error(instance, fmi2Error, "fmi2Instantiate: the FMU was compiled to fuse products and sums, which changes "
                                       "its results; add -ffp-contract=off (/fp:precise)");
    } else if (make(instance, name, type, guid, resources, visible, logging_on)) {
        return instance;
    }
    free(instance);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) {
    Instance *instance = (Instance *)c;
    Call call;
    if (instance == NULL || instance->module.w2c_memory.trap != NULL) {
        return;
    }
    begin(&call, instance, "fmi2FreeInstance");
    if (setjmp(call.trap) == 0) {
        if (!instance->dead) {
            FMU_fmi2FreeInstance(&instance->module, instance->component);
        }
    }
    free(instance);
}

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean logging_on, size_t n, const fmi2String categories[]) {
    BEGIN("fmi2SetDebugLogging")
    RESERVE("fmi2SetDebugLogging", n, sizeof(u32), 64 + length_of_all(categories, n))
    CALL(FMU_fmi2SetDebugLogging, (u32)logging_on, count(&call, n), strings(&call, categories, n));
    END
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean tolerance_defined, fmi2Real tolerance,
                               fmi2Real start_time, fmi2Boolean stop_time_defined, fmi2Real stop_time) {
    BEGIN("fmi2SetupExperiment")
    CALL(FMU_fmi2SetupExperiment, (u32)tolerance_defined, tolerance, start_time, (u32)stop_time_defined, stop_time);
    END
}

fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) {
    BEGIN("fmi2SetTime")
    CALL(FMU_fmi2SetTime, time);
    END
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real point, fmi2Real size, fmi2Boolean no_set_state_prior) {
    BEGIN("fmi2DoStep")
    CALL(FMU_fmi2DoStep, point, size, (u32)no_set_state_prior);
    END
}

/* Functions that differ only in their names, which are macros in the headers of FMI: `#` and `##` do not expand those. */

#define WITHOUT_ARGUMENTS(name)                                                  \
    fmi2Status name(fmi2Component c) {                                           \
        BEGIN(#name)                                                             \
        status = (fmi2Status)FMU_##name(&instance->module, instance->component); \
        END                                                                      \
    }

WITHOUT_ARGUMENTS(fmi2EnterInitializationMode)
WITHOUT_ARGUMENTS(fmi2ExitInitializationMode)
WITHOUT_ARGUMENTS(fmi2Terminate)
WITHOUT_ARGUMENTS(fmi2Reset)
WITHOUT_ARGUMENTS(fmi2CancelStep)
WITHOUT_ARGUMENTS(fmi2EnterEventMode)
WITHOUT_ARGUMENTS(fmi2EnterContinuousTimeMode)

#define GET_AND_SET(get, set, type)                                                                \
    fmi2Status get(fmi2Component c, const fmi2ValueReference vr[], size_t n, type value[]) {       \
        u32 values;                                                                                \
        BEGIN(#get)                                                                                \
        RESERVE(#get, n, sizeof *vr + sizeof *value, 64)                                           \
        values = OUT(value, n, type);                                                              \
        CALL(FMU_##get, IN(vr, n, fmi2ValueReference), count(&call, n), values);                   \
        COPY_OUT(value, values, n)                                                                 \
        END                                                                                        \
    }                                                                                              \
    fmi2Status set(fmi2Component c, const fmi2ValueReference vr[], size_t n, const type value[]) { \
        BEGIN(#set)                                                                                \
        RESERVE(#set, n, sizeof *vr + sizeof *value, 64)                                           \
        CALL(FMU_##set, IN(vr, n, fmi2ValueReference), count(&call, n), IN(value, n, type));       \
        END                                                                                        \
    }

GET_AND_SET(fmi2GetReal, fmi2SetReal, fmi2Real)
GET_AND_SET(fmi2GetInteger, fmi2SetInteger, fmi2Integer)
GET_AND_SET(fmi2GetBoolean, fmi2SetBoolean, fmi2Boolean)

fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String value[]) {
    u32 values;
    size_t i;
    BEGIN("fmi2GetString")
    RESERVE("fmi2GetString", n, sizeof *vr + sizeof(u32), 64)
    values = output(&call, value, n, sizeof(u32), ALIGNMENT(fmi2String));
    CALL(FMU_fmi2GetString, IN(vr, n, fmi2ValueReference), count(&call, n), values);
    for (i = 0; status == fmi2OK && i < n; i++) {
        u32 text;
        memcpy(&text, at(&call, values + (u32)(i * sizeof text)), sizeof text);
        value[i] = (fmi2String)at(&call, text);
    }
    END
}

fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String value[]) {
    BEGIN("fmi2SetString")
    RESERVE("fmi2SetString", n, sizeof *vr + sizeof(u32), 64 + length_of_all(value, n))
    CALL(FMU_fmi2SetString, IN(vr, n, fmi2ValueReference), count(&call, n), strings(&call, value, n));
    END
}

/* The module's handles of saved states are numbers, and equal numbers in different instances are different states. So the
   importer's handle is the sum of the number and the instance's address; it is never dereferenced.

   Returns the module's handle: 0 for NULL, and UINT32_MAX for a handle that cannot be valid, so that the module rejects it. */
static u32 to_module(const Instance *instance, fmi2FMUstate state) {
    uintptr_t handle = (uintptr_t)state - (uintptr_t)instance;
    if (state == NULL) {
        return 0;
    }
    return handle != 0 && (u32)handle == handle ? (u32)handle : UINT32_MAX;
}

static fmi2FMUstate to_importer(const Instance *instance, u32 handle) {
    return handle == 0 ? NULL : (fmi2FMUstate)((uintptr_t)instance + handle);
}

/* Copies the importer's handle of a state into the module, unless the pointer to it is NULL or unaligned. */
#define STATE_IN(name, state, n)                                                   \
    u32 state_address;                                                             \
    RESERVE(name, n, 1, 64)                                                        \
    state_address = output(&call, state, 1, sizeof(u32), ALIGNMENT(fmi2FMUstate)); \
    if (state_address != 0 && state_address % sizeof(u32) == 0) {                  \
        u32 in_module = to_module(instance, *state);                               \
        memcpy(at(&call, state_address), &in_module, sizeof in_module);            \
    }

#define STATE_OUT(state)                                                \
    if (status == fmi2OK && (state) != NULL) {                          \
        u32 in_module;                                                  \
        memcpy(&in_module, at(&call, state_address), sizeof in_module); \
        *(state) = to_importer(instance, in_module);                    \
    }

#define STATE_HANDLE(name)                                  \
    fmi2Status name(fmi2Component c, fmi2FMUstate *state) { \
        BEGIN(#name)                                        \
        STATE_IN(#name, state, 0)                           \
        CALL(FMU_##name, state_address);                    \
        STATE_OUT(state)                                    \
        END                                                 \
    }

STATE_HANDLE(fmi2GetFMUstate)
STATE_HANDLE(fmi2FreeFMUstate)

fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state) {
    BEGIN("fmi2SetFMUstate")
    CALL(FMU_fmi2SetFMUstate, to_module(instance, state));
    END
}

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate state, size_t *size) {
    u32 sizes, written;
    BEGIN("fmi2SerializedFMUstateSize")
    RESERVE("fmi2SerializedFMUstateSize", 0, 1, 64)
    sizes = output(&call, size, 1, sizeof(u32), ALIGNMENT(size_t));
    CALL(FMU_fmi2SerializedFMUstateSize, to_module(instance, state), sizes);
    if (status == fmi2OK) {
        memcpy(&written, at(&call, sizes), sizeof written);
        *size = written;
    }
    END
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate state, fmi2Byte byte[], size_t n) {
    u32 bytes;
    BEGIN("fmi2SerializeFMUstate")
    RESERVE("fmi2SerializeFMUstate", n, 1, 64)
    bytes = OUT(byte, n, fmi2Byte);
    CALL(FMU_fmi2SerializeFMUstate, to_module(instance, state), bytes, count(&call, n));
    COPY_OUT(byte, bytes, n)
    END
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte byte[], size_t n, fmi2FMUstate *state) {
    BEGIN("fmi2DeSerializeFMUstate")
    STATE_IN("fmi2DeSerializeFMUstate", state, n)
    CALL(FMU_fmi2DeSerializeFMUstate, IN(byte, n, fmi2Byte), count(&call, n), state_address);
    STATE_OUT(state)
    END
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference unknown[], size_t n_unknown,
                                        const fmi2ValueReference known[], size_t n_known, const fmi2Real dv_known[],
                                        fmi2Real dv_unknown[]) {
    u32 result;
    BEGIN("fmi2GetDirectionalDerivative")
    RESERVE("fmi2GetDirectionalDerivative", n_known, 12, 64)
    RESERVE("fmi2GetDirectionalDerivative", n_unknown, 12, 64 + (call.endless ? 0 : n_known * 12))
    result = OUT(dv_unknown, n_unknown, fmi2Real);
    CALL(FMU_fmi2GetDirectionalDerivative, IN(unknown, n_unknown, fmi2ValueReference), count(&call, n_unknown),
         IN(known, n_known, fmi2ValueReference), count(&call, n_known), IN(dv_known, n_known, fmi2Real), result);
    COPY_OUT(dv_unknown, result, n_unknown)
    END
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    BEGIN("fmi2SetRealInputDerivatives")
    RESERVE("fmi2SetRealInputDerivatives", n, 16, 64)
    CALL(FMU_fmi2SetRealInputDerivatives, IN(vr, n, fmi2ValueReference), count(&call, n), IN(order, n, fmi2Integer),
         IN(value, n, fmi2Real));
    END
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real value[]) {
    u32 values;
    BEGIN("fmi2GetRealOutputDerivatives")
    RESERVE("fmi2GetRealOutputDerivatives", n, 16, 64)
    values = OUT(value, n, fmi2Real);
    CALL(FMU_fmi2GetRealOutputDerivatives, IN(vr, n, fmi2ValueReference), count(&call, n), IN(order, n, fmi2Integer),
         values);
    COPY_OUT(value, values, n)
    END
}

#define STATUS(name, type)                                                     \
    fmi2Status name(fmi2Component c, const fmi2StatusKind kind, type *value) { \
        u32 address;                                                           \
        BEGIN(#name)                                                           \
        RESERVE(#name, 0, 1, 64)                                               \
        address = OUT(value, 1, type);                                         \
        CALL(FMU_##name, (u32)kind, address);                                  \
        COPY_OUT(value, address, 1)                                            \
        END                                                                    \
    }

/* The module never returns a value of type fmi2Status or fmi2String, so these types need no conversion. */
STATUS(fmi2GetStatus, fmi2Status)
STATUS(fmi2GetRealStatus, fmi2Real)
STATUS(fmi2GetIntegerStatus, fmi2Integer)
STATUS(fmi2GetBooleanStatus, fmi2Boolean)
STATUS(fmi2GetStringStatus, fmi2String)

/* fmi2EventInfo as the module writes it: five flags, padding and a time. */
typedef struct {
    u32 flags[6];
    double next_event_time;
} EventInfo;

fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) {
    EventInfo event;
    u32 address;
    BEGIN("fmi2NewDiscreteStates")
    RESERVE("fmi2NewDiscreteStates", 0, 1, 64)
    address = output(&call, info, 1, sizeof event, ALIGNMENT(fmi2EventInfo));
    CALL(FMU_fmi2NewDiscreteStates, address);
    if (status == fmi2OK) {
        memcpy(&event, at(&call, address), sizeof event);
        info->newDiscreteStatesNeeded = (fmi2Boolean)event.flags[0];
        info->terminateSimulation = (fmi2Boolean)event.flags[1];
        info->nominalsOfContinuousStatesChanged = (fmi2Boolean)event.flags[2];
        info->valuesOfContinuousStatesChanged = (fmi2Boolean)event.flags[3];
        info->nextEventTimeDefined = (fmi2Boolean)event.flags[4];
        info->nextEventTime = event.next_event_time;
    }
    END
}

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean no_set_state_prior, fmi2Boolean *enter_event_mode,
                                       fmi2Boolean *terminate) {
    u32 enter_address, terminate_address;
    BEGIN("fmi2CompletedIntegratorStep")
    RESERVE("fmi2CompletedIntegratorStep", 0, 1, 64)
    enter_address = OUT(enter_event_mode, 1, fmi2Boolean);
    terminate_address = OUT(terminate, 1, fmi2Boolean);
    CALL(FMU_fmi2CompletedIntegratorStep, (u32)no_set_state_prior, enter_address, terminate_address);
    COPY_OUT(enter_event_mode, enter_address, 1)
    COPY_OUT(terminate, terminate_address, 1)
    END
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t n) {
    BEGIN("fmi2SetContinuousStates")
    RESERVE("fmi2SetContinuousStates", n, sizeof *x, 64)
    CALL(FMU_fmi2SetContinuousStates, IN(x, n, fmi2Real), count(&call, n));
    END
}

#define GET_VECTOR(name)                                       \
    fmi2Status name(fmi2Component c, fmi2Real x[], size_t n) { \
        u32 values;                                            \
        BEGIN(#name)                                           \
        RESERVE(#name, n, sizeof *x, 64)                       \
        values = OUT(x, n, fmi2Real);                          \
        CALL(FMU_##name, values, count(&call, n));             \
        COPY_OUT(x, values, n)                                 \
        END                                                    \
    }

GET_VECTOR(fmi2GetDerivatives)
GET_VECTOR(fmi2GetEventIndicators)
GET_VECTOR(fmi2GetContinuousStates)
GET_VECTOR(fmi2GetNominalsOfContinuousStates)
