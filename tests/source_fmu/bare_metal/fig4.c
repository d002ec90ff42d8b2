/* Runs the two experiments of Fig. 4 without an operating system and prints the bits of each output after each step, then the memory and
   the instructions that it needs. motion.h has the guid, the value references and the motor angles of both experiments. */
#include "fmi2Functions.h"
#include "motion.h"
#include "startup.h"
#include <stdint.h>

#define OUTPUTS 4
#define STEP 0.001

/* SysTick counts down at the processor's clock (Armv7-M manual, B3.3). */
#define SYSTICK ((volatile uint32_t *)0xe000e010u)
#define COUNTER_BITS 0xffffffu

static fmi2Component fmu;

static void print_hexadecimal(uint64_t value, int digits) {
    char text[18];
    int i;
    for (i = 0; i < digits; i++) {
        text[i] = "0123456789abcdef"[value >> (4 * (digits - 1 - i)) & 15];
    }
    text[digits] = ' ';
    text[digits + 1] = '\0';
    print(text);
}

static void print_number(const char *name, uint32_t value) {
    print(name);
    print(" ");
    print_hexadecimal(value, 8);
    print("\n");
}

static void require(fmi2Status status, const char *what) {
    if (status != fmi2OK) {
        print("failed ");
        print(what);
        stop(1);
    }
}

static void log_message(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message,
                        ...) {
    (void)environment, (void)name, (void)status, (void)category;
    print("log ");
    print(message);
    print("\n");
}

static uint32_t ticks_since(uint32_t begin) {
    return (begin - SYSTICK[2]) & COUNTER_BITS;
}

/* The ticks of 20,000 instructions, from which the instructions of a step are calculated. */
static uint32_t ticks_of_20000_instructions(void) {
    uint32_t begin = SYSTICK[2], count = 10000;
    __asm volatile("1: subs %0, #1\n bne 1b" : "+r"(count) : : "cc");
    return ticks_since(begin);
}

/* Sets the angles, makes a step and reads the outputs, as a controller does in each period. Returns its ticks. */
static uint32_t step(int number, const double angles[2], double outputs[OUTPUTS]) {
    uint32_t begin = SYSTICK[2];
    require(fmi2SetReal(fmu, input_references, 2, angles), "fmi2SetReal");
    require(fmi2DoStep(fmu, number * STEP, STEP, fmi2True), "fmi2DoStep");
    require(fmi2GetReal(fmu, output_references, OUTPUTS, outputs), "fmi2GetReal");
    return ticks_since(begin);
}

/* Initializes the instance, and makes a step that is undone, because the first step of a size calculates its matrices. Returns the ticks of
   that step. */
static uint32_t initialize(const double angles[2]) {
    fmi2FMUstate state = NULL;
    double outputs[OUTPUTS];
    uint32_t ticks;
    require(fmi2SetupExperiment(fmu, fmi2False, 0, 0, fmi2False, 0), "fmi2SetupExperiment");
    require(fmi2EnterInitializationMode(fmu), "fmi2EnterInitializationMode");
    require(fmi2ExitInitializationMode(fmu), "fmi2ExitInitializationMode");
    require(fmi2GetFMUstate(fmu, &state), "fmi2GetFMUstate");
    ticks = step(0, angles, outputs);
    require(fmi2SetFMUstate(fmu, state), "fmi2SetFMUstate");
    require(fmi2FreeFMUstate(fmu, &state), "fmi2FreeFMUstate");
    return ticks;
}

int main(void) {
    static const fmi2CallbackFunctions callbacks = {log_message, NULL, NULL, NULL, NULL};
    uint32_t first, most = 0, sum = 0;
    int run, number, output;
    SYSTICK[1] = COUNTER_BITS;
    SYSTICK[0] = 5; /* the processor's clock, no interrupt */
    print_number("ticks", ticks_of_20000_instructions());
    fmu = fmi2Instantiate("fig4", fmi2CoSimulation, GUID, NULL, &callbacks, fmi2False, fmi2False);
    if (fmu == NULL) {
        print("failed fmi2Instantiate");
        return 1;
    }
    is_started = true;
    for (run = 0; run < 2; run++) {
        require(fmi2Reset(fmu), "fmi2Reset");
        first = initialize(angles[run][0]);
        for (number = 0; number < STEPS; number++) {
            double outputs[OUTPUTS];
            uint32_t ticks = step(number, angles[run][number], outputs);
            most = ticks > most ? ticks : most;
            sum += ticks;
            print("outputs ");
            for (output = 0; output < OUTPUTS; output++) {
                union {
                    double value;
                    uint64_t bits;
                } of;
                of.value = outputs[output];
                print_hexadecimal(of.bits, 16);
            }
            print("\n");
        }
    }
    print_number("first", first);
    print_number("most", most);
    print_number("mean", sum / (2 * STEPS));
    print_number("allocated", allocated);
    print_number("stack", used_stack());
    return 0;
}
