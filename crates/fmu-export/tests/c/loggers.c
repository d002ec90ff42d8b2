/* Some importers format a log message as printf does, but others show the format string unchanged. Checks that both show the
   same text, regardless of the characters in it: loggers LIBRARY GUID. */
#include "fmu.h"
#include <stdarg.h>

static char formatted[20][1000], plain[20][1000];
static int formatted_count, plain_count;

static void format(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                   fmi2String category, fmi2String message, ...) {
    va_list arguments;
    CHECK(environment == NULL && status <= fmi2Fatal && category);
    va_start(arguments, message);
    int start = snprintf(formatted[formatted_count], 1000, "[%s] ", instance_name);
    vsnprintf(formatted[formatted_count++] + start, 900, message, arguments);
    va_end(arguments);
}

static void take(fmi2ComponentEnvironment environment, fmi2String instance_name, fmi2Status status,
                 fmi2String category, fmi2String message, ...) {
    CHECK(environment == NULL && status <= fmi2Fatal && category);
    snprintf(plain[plain_count++], 1000, "[%s] %s", instance_name, message);
}

/* Makes calls whose messages mostly quote strings that the importer has passed. */
static void provoke(const char *guid, fmi2CallbackFunctions callbacks) {
    const fmi2String wishes[] = {"%s%s%n", "#r1#"};
    const unsigned vr = 99;
    const fmi2Real value = 0;
    fmi2Component c;
    CHECK(!fmi2Instantiate("model", fmi2CoSimulation, "{%n%s%d} #r0# 100%", "", &callbacks, 0, 1));
    CHECK((c = fmi2Instantiate("a#b", fmi2CoSimulation, guid, "", &callbacks, 0, 1)));
    CHECK(fmi2SetDebugLogging(c, 1, 1, wishes) == fmi2Error);
    CHECK(fmi2SetDebugLogging(c, 1, 1, wishes + 1) == fmi2Error);
    CHECK(fmi2SetReal(c, &vr, 1, &value) == fmi2Error);
    CHECK(fmi2DoStep(c, 0, 1, 1) == fmi2Error);
    fmi2FreeInstance(c);
}

int main(int argc, char **argv) {
    fmi2CallbackFunctions callbacks = {format, NULL, NULL, NULL, NULL};
    CHECK(argc == 3);
    void *library = load(argv[1]);
    provoke(argv[2], callbacks);
    callbacks.logger = take;
    provoke(argv[2], callbacks);
    CHECK(formatted_count == 6 && plain_count == 6);
    for (int i = 0; i < 6; ++i) {
        if (strcmp(formatted[i], plain[i]) != 0) fprintf(stderr, "%s\n%s\n", formatted[i], plain[i]);
        CHECK(strcmp(formatted[i], plain[i]) == 0);
        printf("%s\n", plain[i]);
    }
    return dlclose(library);
}
