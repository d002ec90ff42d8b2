/* The experiment of Fig. 4 with libcosim as the master: libcosim LIBCOSIMC FMU. Prints the outputs of every step.
   The functions are declared as in libcosim's cosim.h; variables.h is made by conftest.py. */
#include <dlfcn.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "variables.h"

static const unsigned outputs[] = OUTPUTS;

enum { STEPS = 200, N_OUTPUTS = sizeof outputs / sizeof *outputs };

#define FUNCTIONS(F) \
    F(void *, cosim_execution_create, (int64_t start, int64_t step)) \
    F(void *, cosim_local_slave_create, (const char *fmu, const char *name)) \
    F(int, cosim_execution_add_slave, (void *execution, void *slave)) \
    F(void *, cosim_override_manipulator_create, (void)) \
    F(int, cosim_execution_add_manipulator, (void *execution, void *manipulator)) \
    F(void *, cosim_last_value_observer_create, (void)) \
    F(int, cosim_execution_add_observer, (void *execution, void *observer)) \
    F(int, cosim_manipulator_slave_set_real, (void *, int, const unsigned *, size_t, const double *)) \
    F(int, cosim_observer_slave_get_real, (void *, int, const unsigned *, size_t, double *)) \
    F(int, cosim_execution_step, (void *execution, size_t steps)) \
    F(int, cosim_local_slave_destroy, (void *slave)) \
    F(int, cosim_execution_destroy, (void *execution)) \
    F(const char *, cosim_last_error_message, (void))

#define DEFINE(result, name, arguments) static result(*name) arguments;
FUNCTIONS(DEFINE)

static void stop(const char *why) {
    fprintf(stderr, "%s\n", why);
    exit(1);
}

#define CHECK(condition) \
    do { \
        if (!(condition)) stop(cosim_last_error_message()); \
    } while (0)

int main(int argc, char **argv) {
    const unsigned motors[] = {VR_theta1, VR_theta2};
    const double h = 0.01, pi = 3.14159265358979323846;
    void *library, *execution, *slave, *manipulator, *observer;
    int index, i, j;
    if (argc != 3) stop("libcosim LIBCOSIMC FMU");
    library = dlopen(argv[1], RTLD_NOW);
    if (!library) stop(dlerror());
#define LOAD(result, name, arguments) \
    if (!(*(void **)&name = dlsym(library, #name))) stop("no " #name);
    FUNCTIONS(LOAD)

    CHECK(execution = cosim_execution_create(0, 10000000));
    CHECK(slave = cosim_local_slave_create(argv[2], "testbed"));
    CHECK((index = cosim_execution_add_slave(execution, slave)) >= 0);
    CHECK(manipulator = cosim_override_manipulator_create());
    CHECK(cosim_execution_add_manipulator(execution, manipulator) == 0);
    CHECK(observer = cosim_last_value_observer_create());
    CHECK(cosim_execution_add_observer(execution, observer) == 0);
    for (i = 0; i < STEPS; ++i) {
        const double angle = (1 - cos(10 * pi * i * h)) / (10 * pi), angles[] = {angle, -angle};
        double values[N_OUTPUTS];
        CHECK(cosim_manipulator_slave_set_real(manipulator, index, motors, 2, angles) == 0);
        CHECK(cosim_execution_step(execution, 1) == 0);
        CHECK(cosim_observer_slave_get_real(observer, index, outputs, N_OUTPUTS, values) == 0);
        fputs("outputs", stdout);
        for (j = 0; j < N_OUTPUTS; ++j) printf(" %.17g", values[j]);
        putchar('\n');
    }
    CHECK(cosim_execution_destroy(execution) == 0 && cosim_local_slave_destroy(slave) == 0);
    return 0;
}
