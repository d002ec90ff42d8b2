/* The experiment of Fig. 4 with Ecos as the master: ecos FMU [LIBTBB] LIBECOSC. Prints the outputs of every step.
   The functions are declared as in the Python of ecospy. */
#include <dlfcn.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>

static const char *const outputs[] = {"tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate", "theta3", "theta4"};

enum { STEPS = 200, N_OUTPUTS = sizeof outputs / sizeof *outputs };

#define FUNCTIONS(F) \
    F(void *, ecos_simulation_structure_create, (void)) \
    F(bool, ecos_simulation_structure_add_model, (void *, const char *name, const char *fmu, double step)) \
    F(void, ecos_simulation_structure_destroy, (void *)) \
    F(void *, ecos_simulation_create_from_structure, (void *, double step)) \
    F(bool, ecos_simulation_init, (void *, double start, const char *parameters)) \
    F(bool, ecos_simulation_set_real, (void *, const char *name, double value)) \
    F(bool, ecos_simulation_get_real, (void *, const char *name, double *value)) \
    F(double, ecos_simulation_step, (void *, size_t steps)) \
    F(bool, ecos_simulation_terminate, (void *)) \
    F(void, ecos_simulation_destroy, (void *)) \
    F(const char *, ecos_last_error_msg, (void))

#define DEFINE(result, name, arguments) static result(*name) arguments;
FUNCTIONS(DEFINE)

static void stop(const char *why) {
    fprintf(stderr, "%s\n", why);
    exit(1);
}

#define CHECK(condition) \
    do { \
        if (!(condition)) stop(ecos_last_error_msg()); \
    } while (0)

int main(int argc, char **argv) {
    const double h = 0.01, pi = 3.14159265358979323846;
    void *library = NULL, *structure, *simulation;
    int i, j;
    if (argc < 3) stop("ecos FMU [LIBTBB] LIBECOSC");
    for (i = 2; i < argc; ++i) {
        library = dlopen(argv[i], RTLD_NOW);
        if (!library) stop(dlerror());
    }
#define LOAD(result, name, arguments) \
    if (!(*(void **)&name = dlsym(library, #name))) stop("no " #name);
    FUNCTIONS(LOAD)

    CHECK(structure = ecos_simulation_structure_create());
    CHECK(ecos_simulation_structure_add_model(structure, "testbed", argv[1], h));
    CHECK(simulation = ecos_simulation_create_from_structure(structure, h));
    CHECK(ecos_simulation_init(simulation, 0, NULL));
    for (i = 0; i < STEPS; ++i) {
        const double angle = (1 - cos(10 * pi * i * h)) / (10 * pi);
        CHECK(ecos_simulation_set_real(simulation, "testbed::theta1", angle));
        CHECK(ecos_simulation_set_real(simulation, "testbed::theta2", -angle));
        ecos_simulation_step(simulation, 1);
        fputs("outputs", stdout);
        for (j = 0; j < N_OUTPUTS; ++j) {
            char name[40];
            double value;
            snprintf(name, sizeof name, "testbed::%s", outputs[j]);
            CHECK(ecos_simulation_get_real(simulation, name, &value));
            printf(" %.17g", value);
        }
        putchar('\n');
    }
    CHECK(ecos_simulation_terminate(simulation));
    ecos_simulation_destroy(simulation);
    ecos_simulation_structure_destroy(structure);
    return 0;
}
