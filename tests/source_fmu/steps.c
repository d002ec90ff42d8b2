/* Steps with the FMU's C sources, which are part of this program, and prints a hash of the outputs and the memory use. Also fills the
   memory with saved states, and damages an instance. If THREADS is defined, steps one instance in each of that many threads. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

static int allocations, threads_run;

static void *counted(size_t count, size_t size) {
    if (!threads_run) {
        allocations++;
    }
    return (calloc)(count, size);
}
#define calloc counted
#include "prw_testbed_fmi2.c"
#undef calloc

#define STEPS 2000
#define OUTPUTS 4

static uint64_t hashed(uint64_t before, const void *bytes, size_t count) {
    const unsigned char *byte = bytes;
    while (count-- > 0) {
        before = (before ^ *byte++) * 0x100000001b3u;
    }
    return before;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    printf("log %s %d %s: %s\n", name, status, category, message);
}

static const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, NULL};
static const char *guid;
static fmi2ValueReference inputs[2], outputs[OUTPUTS];

static void initialize(Instance *fmu) {
    if (fmi2SetupExperiment(fmu, fmi2False, 0, 0, fmi2False, 0) != fmi2OK ||
        fmi2EnterInitializationMode(fmu) != fmi2OK || fmi2ExitInitializationMode(fmu) != fmi2OK) {
        exit(1);
    }
}

static Instance *start(void) {
    Instance *fmu = fmi2Instantiate("steps", fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, fmi2False);
    if (fmu == NULL) {
        exit(1);
    }
    initialize(fmu);
    return fmu;
}

/* The angles are polynomials of time, so they are bit-identical with every C library. */
static uint64_t run(Instance *fmu) {
    uint64_t value = 0xcbf29ce484222325u;
    int i;
    for (i = 0; i < STEPS; i++) {
        double t = i * 0.001, angles[2], values[OUTPUTS];
        angles[0] = t * (1 - t);
        angles[1] = t * (t - 0.5);
        if (fmi2SetReal(fmu, inputs, 2, angles) != fmi2OK || fmi2DoStep(fmu, t, 0.001, fmi2True) != fmi2OK ||
            fmi2GetReal(fmu, outputs, OUTPUTS, values) != fmi2OK) {
            exit(1);
        }
        value = hashed(value, values, sizeof values);
    }
    return value;
}

#ifdef THREADS
#include <pthread.h>

static void *on_thread(void *hash) {
    Instance *fmu = start();
    *(uint64_t *)hash = run(fmu);
    fmi2FreeInstance(fmu);
    return NULL;
}

static void on_threads(void) {
    pthread_t threads[THREADS];
    uint64_t hashes[THREADS];
    int i;
    threads_run = 1;
    for (i = 0; i < THREADS; i++) {
        pthread_create(&threads[i], NULL, on_thread, &hashes[i]);
    }
    for (i = 0; i < THREADS; i++) {
        pthread_join(threads[i], NULL);
        printf("thread %016llx\n", (unsigned long long)hashes[i]);
    }
}
#else
static void on_threads(void) {}
#endif

static fmi2FMUstate states[1000];

static int save_until_full(Instance *fmu) {
    int count = 0;
    while (count < 1000 && fmi2GetFMUstate(fmu, &states[count]) == fmi2OK) {
        count++;
    }
    printf("states %d\n", count);
    return count;
}

static void release(Instance *fmu, int i) {
    if (fmi2FreeFMUstate(fmu, &states[i]) != fmi2OK) {
        exit(1);
    }
}

/* Saves states until the memory is full, and checks that another one fits in the place of two, and that the instance still works. The
   place of one can be too small, because free memory is fragmented. Frees all states. */
static void fill(Instance *fmu) {
    int i, count = save_until_full(fmu);
    printf("full %d\n", fmi2GetFMUstate(fmu, &states[999]));
    for (i = 0; i + 1 < count; i += 2) {
        release(fmu, i);
        release(fmu, i + 1);
        if (fmi2GetFMUstate(fmu, &states[i]) != fmi2OK) {
            exit(1);
        }
        fmi2GetFMUstate(fmu, &states[i + 1]);
    }
    if (fmi2Reset(fmu) != fmi2OK) {
        exit(1);
    }
    initialize(fmu);
    printf("hash %016llx\n", (unsigned long long)run(fmu));
    while (count-- > 0) {
        release(fmu, count);
    }
}

/* Saves and frees states often. If this lost memory, the printed number of states would fall. */
static void fill_often(Instance *fmu) {
    int i, count;
    for (i = 0; i < 100; i++) {
        count = save_until_full(fmu);
        while (count-- > 0) {
            release(fmu, count);
        }
    }
}

int main(int count, char **arguments) {
    Instance *fmu, *other;
    fmi2FMUstate state = NULL;
    const uint8_t *memory;
    u32 stack = 0;
    int i, made;
    if (count != 4 + OUTPUTS) {
        return 1;
    }
    guid = arguments[1];
    for (i = 0; i < 2 + OUTPUTS; i++) {
        *(i < 2 ? &inputs[i] : &outputs[i - 2]) = (fmi2ValueReference)strtoul(arguments[2 + i], NULL, 10);
    }
    fmu = start();
    other = start();
    made = allocations;
    printf("hash %016llx\n", (unsigned long long)run(fmu));
    if (fmi2GetFMUstate(fmu, &state) != fmi2OK || fmi2SetFMUstate(fmu, state) != fmi2OK ||
        fmi2FreeFMUstate(fmu, &state) != fmi2OK || fmi2Reset(fmu) != fmi2OK) {
        return 1;
    }
    printf("allocations after fmi2Instantiate: %d\n", allocations - made);
    /* The stack grows down from 64 KiB, so the first byte that is not 0 is the lowest one that was used. */
    memory = fmu->module.w2c_memory.data.bytes;
    while (memory[stack] == 0) {
        stack++;
    }
    printf("stack %u\n", 65536 - stack);
    printf("memory %u\n", (unsigned)fmu->module.w2c_memory.pages);
    printf("block %u\n", (unsigned)sizeof(Instance));

    fill(fmu);
    fill(fmu);
    fill_often(fmu);

    /* Damages the module of one instance, which can then only be freed. The other instance must not be affected. */
    for (i = 0; i < FMU_TABLE; i++) {
        fmu->module.w2c_T0.data[i].func_type = NULL;
    }
    memset(fmu->module.w2c_memory.data.bytes + 65536, 0xff, FMU_INITIAL_PAGES * FMU_PAGE - 65536);
    printf("damaged %d\n", fmi2Reset(fmu));
    printf("damaged %d\n", fmi2Reset(fmu));
    fmi2FreeInstance(fmu);
    printf("hash %016llx\n", (unsigned long long)run(other));
    fmi2FreeInstance(other);
    on_threads();
    return 0;
}
