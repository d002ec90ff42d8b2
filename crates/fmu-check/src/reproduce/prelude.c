#define _GNU_SOURCE
#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>
#if defined(__GLIBC__)
#include <malloc.h>
#endif

typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} Callbacks;

static void *library;

/* A function of the library. */
static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) { printf("%s is not in the library\n", name); exit(3); }
    return found;
}

/* An array that ends where memory ends: what is read or written beyond it is a crash. */
static __attribute__((unused)) void *guarded(const void *bytes, size_t size) {
    size_t page = (size_t)sysconf(_SC_PAGESIZE), length = ((size + page - 1) / page + 1) * page;
    char *map = mmap(NULL, length, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (map == MAP_FAILED) { perror("mmap"); exit(3); }
    mprotect(map + length - page, page, PROT_NONE);
    char *array = map + length - page - size;
    if (bytes) memcpy(array, bytes, size); else memset(array, 0x5a, size);
    return array;
}

static __attribute__((unused)) void say2(void *environment, const char *name, int status, const char *category, const char *text, ...) {
    va_list list;
    (void)environment;
    printf("    log of %s: status %d, category %s: ", name ? name : "NULL", status, category ? category : "NULL");
    va_start(list, text);
    if (text) vprintf(text, list);
    va_end(list);
    printf("\n");
}

static __attribute__((unused)) void say3(void *environment, int status, const char *category, const char *text) {
    (void)environment;
    printf("    log: status %d, category %s: %s\n", status, category ? category : "NULL", text ? text : "NULL");
}

/* Shows numbers that a call wrote; f is for floating-point, the width is in bytes. */
static __attribute__((unused)) void show(const void *array, size_t count, char kind, size_t width) {
    size_t i;
    for (i = 0; i < count; i++) {
        const char *at = (const char *)array + i * width;
        if (kind == 'f' && width == 8) { double d; memcpy(&d, at, 8); printf(" %.17g", d); }
        else if (kind == 'f') { float f; memcpy(&f, at, 4); printf(" %.9g", (double)f); }
        else if (kind == 's') { const char *s; memcpy(&s, at, sizeof s); printf(" \"%s\"", s ? s : "NULL"); }
        else {
            uint64_t word = 0;
            memcpy(&word, at, width);
            if (kind == 'u') printf(" %llu", (unsigned long long)word);
            else if (width == 1) printf(" %d", (int8_t)word);
            else if (width == 2) printf(" %d", (int16_t)word);
            else if (width == 4) printf(" %d", (int32_t)word);
            else printf(" %lld", (long long)word);
        }
    }
}

static __attribute__((unused)) void measure(void) {
    long pages = 0, all = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file) { if (fscanf(file, "%ld %ld", &all, &pages) != 2) pages = 0; fclose(file); }
    printf("resident memory: %ld bytes", pages * sysconf(_SC_PAGESIZE));
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
    { struct mallinfo2 info = mallinfo2(); printf(", in use: %zu bytes", info.uordblks + info.hblkhd); }
#endif
    printf("\n");
}

/* Bytes of a saved state, from one process to the next. */
static __attribute__((unused)) void pass_on(const char *folder, int number, const char *bytes, size_t size) {
    char path[5000];
    FILE *file;
    snprintf(path, sizeof path, "%s/%d", folder, number);
    file = fopen(path, "wb");
    if (file) { fwrite(bytes, 1, size, file); fclose(file); }
}

static __attribute__((unused)) size_t *passed_on(const char *folder, int number, char *bytes) {
    char path[5000];
    FILE *file;
    size_t *size = guarded(NULL, sizeof *size);
    *size = 0;
    snprintf(path, sizeof path, "%s/%d", folder, number);
    file = fopen(path, "rb");
    if (file) { *size = fread(bytes, 1, 1 << 24, file); fclose(file); }
    return size;
}
