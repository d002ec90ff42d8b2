/* Loads FMUs, uses instances of all of them in both FMI versions, frees the instances in varying order, and unloads:
   reload ROUNDS LIBRARY...
   Prints the allocated bytes and the resident memory in KiB after a tenth of the rounds and at the end. */
#include "fmu.h"
#include <malloc.h>
#include <unistd.h>

enum { LIBRARIES = 4, INSTANCES = 3, STEPS = 8, VARIABLES = 16, GUID_LENGTH = 64 };

/* The functions of one library, and its instances for FMI 2.0 and FMI 3.0. */
struct fmu {
#define MEMBER(name) fmi2##name##TYPE *fmi2##name;
    FMI2_FUNCTIONS(MEMBER)
#undef MEMBER
#define MEMBER(name) fmi3##name##TYPE *fmi3##name;
    FMI3_FUNCTIONS(MEMBER)
#undef MEMBER
    void *library;
    fmi2Component instances[INSTANCES];
    fmi2FMUstate states[INSTANCES];
    fmi3Instance instances3[INSTANCES];
    fmi3FMUState states3[INSTANCES];
};

static struct fmu open_fmu(const char *path) {
    struct fmu fmu = {.library = load_both(path)};
#define COPY(name) fmu.fmi2##name = fmi2##name;
    FMI2_FUNCTIONS(COPY)
#undef COPY
#define COPY(name) fmu.fmi3##name = fmi3##name;
    FMI3_FUNCTIONS(COPY)
#undef COPY
    return fmu;
}

/* Reads the guid of an FMU from the message with which it rejects a wrong one. */
static void learn_guid(fmi2ComponentEnvironment guid, fmi2String instance, fmi2Status status, fmi2String category,
                       fmi2String message, ...) {
    const char *own = strstr(message, "library's {");
    (void)instance, (void)status, (void)category;
    if (own && guid) sscanf(own, "library's %63[^:]", (char *)guid);
}

/* Uses an instance of FMI 3.0 without a logger. */
static void use3(struct fmu *fmu, const char *token, int i) {
    fmi3Boolean event, terminate, early;
    fmi3Float64 last;
    fmi3ValueReference vr;
    fmi3String text;
    int k;
    fmi3Instance c = fmu->fmi3InstantiateCoSimulation("some", token, "", false, false, false, false, NULL, 0, NULL,
                                                      NULL, NULL);
    CHECK(c);
    CHECK(fmu->fmi3EnterInitializationMode(c, false, 0, 0, false, 0) == fmi3OK);
    CHECK(fmu->fmi3ExitInitializationMode(c) == fmi3OK);
    for (k = 0; k < STEPS; ++k)
        CHECK(fmu->fmi3DoStep(c, k / 512.0, 1 / 512.0, true, &event, &terminate, &early, &last) == fmi3OK);
    CHECK(fmu->fmi3DoStep(c, -1, 1, true, &event, &terminate, &early, &last) == fmi3Error);
    for (vr = 0; vr < VARIABLES; ++vr) fmu->fmi3GetString(c, &vr, 1, &text, 1);
    CHECK(fmu->fmi3GetFMUState(c, &fmu->states3[i]) == fmi3OK);
    fmu->instances3[i] = c;
}

static void use(struct fmu *fmu) {
    char guid[GUID_LENGTH] = "";
    fmi2CallbackFunctions callbacks = {learn_guid, NULL, NULL, NULL, guid};
    fmi2ValueReference vr;
    fmi2String text;
    int i, k;
    CHECK(!fmu->fmi2Instantiate("none", fmi2CoSimulation, "{}", "", &callbacks, 0, 0) && guid[0] == '{');
    callbacks.componentEnvironment = NULL;
    for (i = 0; i < INSTANCES; ++i) {
        fmi2Component c = fmu->fmi2Instantiate("some", fmi2CoSimulation, guid, "", &callbacks, 0, 0);
        CHECK(c);
        CHECK(fmu->fmi2SetupExperiment(c, 0, 0, 0, 0, 0) == fmi2OK);
        CHECK(fmu->fmi2EnterInitializationMode(c) == fmi2OK && fmu->fmi2ExitInitializationMode(c) == fmi2OK);
        for (k = 0; k < STEPS; ++k) CHECK(fmu->fmi2DoStep(c, k / 512.0, 1 / 512.0, 1) == fmi2OK);
        CHECK(fmu->fmi2DoStep(c, -1, 1, 1) == fmi2Error);
        /* Variables of other types are rejected. */
        for (vr = 0; vr < VARIABLES; ++vr) fmu->fmi2GetString(c, &vr, 1, &text);
        CHECK(fmu->fmi2GetFMUstate(c, &fmu->states[i]) == fmi2OK);
        fmu->instances[i] = c;
        use3(fmu, guid, i);
    }
}

/* Frees the instances, beginning with `first`. Some saved states are freed explicitly, others with their instances. */
static void free_all(struct fmu *fmu, int first) {
    int i;
    for (i = 0; i < INSTANCES; ++i) {
        int own = (first + i) % INSTANCES, other = (own + first) % INSTANCES;
        if (own != other)
            CHECK(fmu->fmi2FreeFMUstate(fmu->instances[own], &fmu->states[own]) == fmi2OK && !fmu->states[own]);
        fmu->fmi2FreeInstance(fmu->instances[own]);
        fmu->states[own] = NULL;
        if (own == i)
            CHECK(fmu->fmi3FreeFMUState(fmu->instances3[other], &fmu->states3[other]) == fmi3OK);
        fmu->fmi3FreeInstance(fmu->instances3[other]);
        fmu->states3[other] = NULL;
    }
    fmu->fmi2FreeInstance(NULL);
    fmu->fmi3FreeInstance(NULL);
}

static void print_memory(void) {
    struct mallinfo2 heap = mallinfo2();
    long size = 0, pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    CHECK(file && fscanf(file, "%ld %ld", &size, &pages) == 2);
    fclose(file);
    printf("%zu %ld\n", heap.uordblks + heap.hblkhd, pages * (sysconf(_SC_PAGESIZE) / 1024));
}

int main(int argc, char **argv) {
    int libraries = argc - 2, rounds = argc > 2 ? atoi(argv[1]) : 0, round, i;
    struct fmu fmus[LIBRARIES];
    CHECK(libraries > 0 && libraries <= LIBRARIES && rounds > 0);
    setvbuf(stdout, NULL, _IONBF, 0); /* a buffer would count as a leak */
    for (round = 0; round < rounds; ++round) {
        for (i = 0; i < libraries; ++i) fmus[i] = open_fmu(argv[2 + (i + round) % libraries]);
        for (i = 0; i < libraries; ++i) use(&fmus[i]);
        for (i = 0; i < libraries; ++i) free_all(&fmus[(i + round) % libraries], round % INSTANCES);
        for (i = 0; i < libraries; ++i) CHECK(dlclose(fmus[i].library) == 0);
        for (i = 0; i < libraries; ++i) CHECK(!dlopen(argv[2 + i], RTLD_NOW | RTLD_NOLOAD));
        if (round == rounds / 10) print_memory();
    }
    print_memory();
    return 0;
}
