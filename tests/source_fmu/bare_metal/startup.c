/* What a program on a Cortex-M7 without an operating system needs besides the FMU's C sources: the start of the processor, memory for one
   instance, and output. The C library provides memcpy, memmove, memset, strlen, setjmp, longjmp and math.h. */
#include "startup.h"
#include <stdbool.h>
#include <stdint.h>

/* Addresses from the linker script. */
extern uint32_t data_begin[], data_end[], data_load[], bss_begin[], bss_end[], stack_end[];

int main(void);

/* Fills the stack, so that the part that was used can be measured. */
#define UNUSED 0x5a5a5a5au

/* Enables the floating-point unit, fills the memory and starts the program. */
static void reset(void) {
    volatile uint32_t *coprocessors = (volatile uint32_t *)0xe000ed88u; /* CPACR, Armv7-M manual, B3.2.20 */
    uint32_t *to, *from = data_load, *here = (uint32_t *)__builtin_frame_address(0);
    *coprocessors |= 0xfu << 20;
    __asm volatile("dsb\n isb");
    for (to = data_begin; to < data_end; to++) {
        *to = *from++;
    }
    for (to = bss_begin; to < bss_end; to++) {
        *to = 0;
    }
    for (to = bss_end; to < here - 64; to++) {
        *to = UNUSED;
    }
    stop(main());
}

size_t used_stack(void) {
    const uint32_t *word = bss_end;
    while (*word == UNUSED) {
        word++;
    }
    return (size_t)((const char *)stack_end - (const char *)word);
}

static void fault(void) {
    print("fault\n");
    stop(1);
}

/* The first words that the processor reads: its stack pointer, and the functions for reset and faults. */
__attribute__((section(".vectors"), used)) static const void *const vectors[] = {
    stack_end, (const void *)reset, (const void *)fault, (const void *)fault, (const void *)fault, (const void *)fault,
};

/* fmi2Instantiate allocates one block per instance, filled with zeros, and its name. Nothing is allocated later. */
size_t allocated;
bool is_started;

void *calloc(size_t count, size_t size) {
    static union {
        double aligned;
        unsigned char bytes[MEMORY];
    } memory;
    size_t begin = allocated, wanted = (count * size + 7u) & ~(size_t)7u;
    if (is_started) {
        fault();
    }
    if (wanted > MEMORY - begin) {
        return NULL;
    }
    allocated += wanted;
    return memory.bytes + begin;
}

void free(void *block) {
    (void)block;
}

/* Output through the debugger or the emulator (semihosting, SYS_WRITE0 and SYS_EXIT_EXTENDED). */
static void call_host(uint32_t operation, const void *argument) {
    register uint32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = argument;
    __asm volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

void print(const char *text) {
    call_host(0x04, text);
}

void stop(int status) {
    const uint32_t reason[2] = {0x20026u, (uint32_t)status}; /* ADP_Stopped_ApplicationExit */
    call_host(0x20, reason);
    for (;;) {
    }
}
