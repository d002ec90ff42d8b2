/* Simulates an FMU as an importer in C does. Usage: drive LIBRARY GUID.
   Prints a line "name value" for each value that the tests compare. The FMU is the test model Oscillator, or the testbed
   if TESTBED is defined. */
#include "fmu.h"

#ifdef TESTBED
enum { THETA1, THETA2, OMEGA1, OMEGA2, TAU1, TAU2, PITCH, ROLL, TRUTH = 32, STATES = 6 };
static const unsigned inputs[] = {THETA1, OMEGA1}, outputs[] = {TAU1, TAU2, PITCH, ROLL};
#else
enum { FORCE, POSITION, VELOCITY, DER_POSITION, DER_VELOCITY, SPRING_FORCE, ENERGY, TRUTH = 11, STATES = 2 };
static const unsigned inputs[] = {FORCE}, outputs[] = {POSITION, VELOCITY, SPRING_FORCE, ENERGY};
#endif

static const char *guid;
static int messages;

static void count(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                  fmi2String category, fmi2String message, ...) {
    CHECK(environment == (void *)&messages);
    CHECK(strcmp(instance_name, "from C") == 0 && category && message[0]);
    CHECK(status <= fmi2Error);
    ++messages;
}

static void *no_memory(size_t n, size_t size) {
    CHECK(!"allocateMemory is called although canNotUseMemoryManagementFunctions is true");
    return (void *)(n + size);
}

static void no_free(void *memory) { CHECK(!memory && !"freeMemory is called"); }

static fmi2Component instantiate(fmi2Type type) {
    fmi2CallbackFunctions callbacks = {count, no_memory, no_free, NULL, &messages};
    char name[] = "from C";
    fmi2Component c = fmi2Instantiate(name, type, guid, "", &callbacks, 0, 0);
    memset(&callbacks, 0, sizeof callbacks);
    memset(name, 'x', sizeof name - 1);
    return c;
}

static void layout(void) {
    printf("sizeof_callbacks %zu\n", sizeof(fmi2CallbackFunctions));
    printf("offset_environment %zu\n", offsetof(fmi2CallbackFunctions, componentEnvironment));
    printf("sizeof_event_info %zu\n", sizeof(fmi2EventInfo));
    printf("offset_next_event_time_defined %zu\n", offsetof(fmi2EventInfo, nextEventTimeDefined));
    printf("offset_next_event_time %zu\n", offsetof(fmi2EventInfo, nextEventTime));
    printf("sizeof_status %zu\n", sizeof(fmi2Status));
    printf("sizeof_type %zu\n", sizeof(fmi2Type));
    printf("sizeof_status_kind %zu\n", sizeof(fmi2StatusKind));
    printf("sizeof_value_reference %zu\n", sizeof(fmi2ValueReference));
    printf("sizeof_boolean %zu\n", sizeof(fmi2Boolean));
    printf("pending %d\n", fmi2Pending);
    CHECK(strcmp(fmi2GetTypesPlatform(), "default") == 0);
    CHECK(strcmp(fmi2GetVersion(), "2.0") == 0);
}

/* Checks that a Boolean is an int of which only 0 and 1 are accepted, and that a getter writes only one int. */
static void booleans(unsigned reference) {
    fmi2Component c = instantiate(fmi2CoSimulation);
    fmi2Boolean values[] = {-1, -1}, yes = 1, two = 256;
    CHECK(fmi2SetBoolean(c, &reference, 1, &two) == fmi2Error && messages == 1);
    CHECK(fmi2SetupExperiment(c, 0, 0, 0, 0, 0) == fmi2OK);
    /* Entering Initialization Mode is rejected until a valid value is set. */
    CHECK(fmi2EnterInitializationMode(c) == fmi2Error && messages == 2);
    CHECK(fmi2SetBoolean(c, &reference, 1, &yes) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2GetBoolean(c, &reference, 1, values) == fmi2OK);
    CHECK(values[0] == 1 && values[1] == -1);
    fmi2FreeInstance(c);
}

/* Sets the first input to the time. The testbed's second input is the rate of the first, 1. */
static void set_inputs(fmi2Component c, double t) {
    const fmi2Real values[] = {t, 1};
    CHECK(fmi2SetReal(c, inputs, sizeof inputs / sizeof *inputs, values) == fmi2OK);
}

static void co_simulation(void) {
    fmi2Real values[5] = {0, 0, 0, 0, 77}, time = 0;
    fmi2Status status = fmi2Pending;
    fmi2Boolean terminated = -1;
    int i;
    fmi2Component c = instantiate(fmi2CoSimulation);
    CHECK(c);
    CHECK(fmi2SetupExperiment(c, 1, 1e-6, 0, 1, 1) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    for (i = 0; i < 64; ++i) {
        set_inputs(c, i / 64.0);
        CHECK(fmi2DoStep(c, i / 64.0, 1 / 64.0, 1) == fmi2OK);
        CHECK(fmi2GetReal(c, outputs, 4, values) == fmi2OK);
    }
    CHECK(values[4] == 77);
    CHECK(fmi2GetRealStatus(c, fmi2LastSuccessfulTime, &time) == fmi2OK && time == 1);
    CHECK(fmi2GetBooleanStatus(c, fmi2Terminated, &terminated) == fmi2OK && terminated == 0);
    CHECK(fmi2GetStatus(c, fmi2DoStepStatus, &status) == fmi2Discard && status == fmi2Pending);
    CHECK(fmi2Terminate(c) == fmi2OK);
    fmi2FreeInstance(c);
    for (i = 0; i < 4; ++i) printf("cs%d %.17g\n", i, values[i]);
}

/* Simulates in Model Exchange with the explicit Euler method, because the results need not be accurate: the test compares
   them with the same calculation in Rust. */
static void model_exchange(void) {
    fmi2Real x[STATES + 1] = {0}, der[STATES + 1] = {0}, nominals[STATES], values[4];
    struct { char before[8]; fmi2EventInfo info; char after[8]; } event;
    fmi2Boolean enter_event_mode[] = {-1, -1}, terminate = -1;
    int i, j;
    fmi2Component c = instantiate(fmi2ModelExchange);
    CHECK(c);
    CHECK(fmi2SetupExperiment(c, 0, 0, 0, 0, 0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    memset(&event, 0x55, sizeof event);
    CHECK(fmi2NewDiscreteStates(c, &event.info) == fmi2OK);
    CHECK(!event.info.newDiscreteStatesNeeded && !event.info.terminateSimulation);
    CHECK(!event.info.nominalsOfContinuousStatesChanged && !event.info.valuesOfContinuousStatesChanged);
    CHECK(!event.info.nextEventTimeDefined);
    for (i = 0; i < 8; ++i) CHECK(event.before[i] == 0x55 && event.after[i] == 0x55);
    CHECK(fmi2EnterContinuousTimeMode(c) == fmi2OK);
    CHECK(fmi2GetNominalsOfContinuousStates(c, nominals, STATES) == fmi2OK);
    CHECK(fmi2GetEventIndicators(c, NULL, 0) == fmi2OK);
    x[STATES] = der[STATES] = 77;
    CHECK(fmi2GetContinuousStates(c, x, STATES) == fmi2OK);
    for (i = 0; i < 1024; ++i) {
        CHECK(fmi2SetTime(c, i / 1024.0) == fmi2OK);
        set_inputs(c, i / 1024.0);
        CHECK(fmi2GetDerivatives(c, der, STATES) == fmi2OK);
        for (j = 0; j < STATES; ++j) x[j] += der[j] / 1024;
        CHECK(fmi2SetContinuousStates(c, x, STATES) == fmi2OK);
        CHECK(fmi2CompletedIntegratorStep(c, 1, enter_event_mode, &terminate) == fmi2OK);
        CHECK(enter_event_mode[0] == 0 && enter_event_mode[1] == -1 && terminate == 0);
    }
    CHECK(x[STATES] == 77 && der[STATES] == 77);
    CHECK(fmi2GetReal(c, outputs, 4, values) == fmi2OK);
    CHECK(fmi2Terminate(c) == fmi2OK);
    fmi2FreeInstance(c);
    for (i = 0; i < 4; ++i) printf("me%d %.17g\n", i, values[i]);
}

/* Checks that the library can be unloaded from the process, as FMPy does after each simulation. */
static void load_and_unload(const char *path) {
    int i;
    for (i = 0; i < 100; ++i) {
        void *library = load(path);
        fmi2Component c = instantiate(i % 2 ? fmi2CoSimulation : fmi2ModelExchange);
        CHECK(c && fmi2Terminate(c) == fmi2Error); /* logs a message */
        fmi2FreeInstance(c);
        CHECK(dlclose(library) == 0);
        CHECK(!dlopen(path, RTLD_NOW | RTLD_NOLOAD)); /* the library is unloaded */
    }
}

int main(int argc, char **argv) {
    CHECK(argc == 3);
    guid = argv[2];
    void *library = load(argv[1]);
    layout();
    booleans(TRUTH);
    co_simulation();
    model_exchange();
    CHECK(dlclose(library) == 0);
    load_and_unload(argv[1]);
    return 0;
}
