/* The sources of two FMUs in one program, each with its prefix: both are initialized and stepped. */
#include <stdio.h>

#include "fmi2FunctionTypes.h"

#define DECLARE(fmu)                                               \
    fmi2InstantiateTYPE fmu##_fmi2Instantiate;                     \
    fmi2SetupExperimentTYPE fmu##_fmi2SetupExperiment;             \
    fmi2EnterInitializationModeTYPE fmu##_fmi2EnterInitializationMode; \
    fmi2ExitInitializationModeTYPE fmu##_fmi2ExitInitializationMode;   \
    fmi2DoStepTYPE fmu##_fmi2DoStep;                               \
    fmi2FreeInstanceTYPE fmu##_fmi2FreeInstance;
DECLARE(prw_testbed)
DECLARE(prw_controller)

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    printf("%s %d %s: %s\n", name, status, category, message);
}

static const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, NULL};

#define START(fmu, guid)                                                                               \
    fmi2Component fmu = prw_##fmu##_fmi2Instantiate(#fmu, fmi2CoSimulation, guid, NULL, &callbacks, fmi2False, \
                                                    fmi2False);                                        \
    if (fmu == NULL || prw_##fmu##_fmi2SetupExperiment(fmu, fmi2False, 0, 0, fmi2False, 0) != fmi2OK || \
        prw_##fmu##_fmi2EnterInitializationMode(fmu) != fmi2OK ||                                      \
        prw_##fmu##_fmi2ExitInitializationMode(fmu) != fmi2OK) {                                       \
        return 1;                                                                                      \
    }

#define STEP(fmu)                                                        \
    if (prw_##fmu##_fmi2DoStep(fmu, 0, 0.001, fmi2True) != fmi2OK) {     \
        return 1;                                                        \
    }                                                                    \
    puts(#fmu);

int main(int count, char **guids) {
    if (count == 3) {
        START(testbed, guids[1])
        START(controller, guids[2])
        STEP(testbed)
        STEP(controller)
        prw_testbed_fmi2FreeInstance(testbed);
        prw_controller_fmi2FreeInstance(controller);
    }
    return count != 3;
}
