#define _GNU_SOURCE
#include <ctype.h>
#include <dlfcn.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <locale.h>
#include <math.h>
#include <dirent.h>
#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#if defined(__linux__)
#include <sys/prctl.h>
#endif
#include <sys/wait.h>
#include <time.h>
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

enum { NONE, END, ORPHANS, RESULTS };

/* Links this program to libm, as most importers are: a library that needs libm, but does not declare that, can then be loaded. */
static __attribute__((used)) double (*volatile needs_libm)(double) = cos;

static void *library;
static char library_path[5000];
/* Output of this program; the standard output belongs to the library. */
static FILE *out;
/* Whether output is switched off; whether the loader resolves all symbols when it loads the library; whether several threads run. */
static bool quiet, bind_now, threads;
/* Time at which the alarm of this program is due. */
static double alarm_ends;
/* Directory for the results of calls, which other processes read. */
static const char *scratch = ".";
/* Messages that were logged during the current call, as hexadecimal digits. */
static __thread char messages[1 << 16];

#define print(...) (quiet ? 0 : fprintf(out ? out : stdout, __VA_ARGS__))

/* Opens a file for results; ends the process if that is not possible. */
static FILE *results(const char *kind, int number, const char *mode) {
    char path[5100];
    FILE *file;
    snprintf(path, sizeof path, "%s/%s%d", scratch, kind, number);
    file = fopen(path, mode);
    if (!file) exit(3);
    return file;
}

/* Returns the contents of a file for results. */
static __attribute__((unused)) char *result(const char *kind, int number) {
    FILE *file = results(kind, number, "r");
    char *text = calloc(1, 1 << 24);
    if (!fread(text, 1, (1 << 24) - 1, file)) *text = 0;
    fclose(file);
    return text;
}

static __attribute__((unused)) bool begins(const char *text, const char *with) {
    return strncmp(text, with, strlen(with)) == 0;
}

/* Returns whether there is anything but white space. */
static __attribute__((unused)) bool has_text(const char *text) {
    return text[strspn(text, " \t\r\n")] != 0;
}

/* Returns whether the results of at least one of these pairs of calls differ. */
static __attribute__((unused)) bool any_differ(const int (*pairs)[2], size_t count) {
    size_t i;
    bool found = false;
    for (i = 0; i < count && !found; i++) {
        char *one = result("r", pairs[i][0]), *other = result("r", pairs[i][1]);
        found = strcmp(one, other) != 0;
        free(one);
        free(other);
    }
    return found;
}

static __attribute__((unused)) void put_numbers(FILE *file, const void *array, size_t count, size_t width) {
    size_t i;
    for (i = 0; i < count; i++) {
        uint64_t word = 0;
        memcpy(&word, (const char *)array + i * width, width);
        fprintf(file, "%llx,", (unsigned long long)word);
    }
    fprintf(file, ";");
}

/* Writes a string as hexadecimal digits; returns the end of the digits. */
static char *put_hex(char *to, const char *text) {
    if (!text) return to + sprintf(to, "-");
    for (; *text; text++) to += sprintf(to, "%02x", (unsigned char)*text);
    *to = 0;
    return to;
}

static __attribute__((unused)) void put_strings(FILE *file, const char *const *array, size_t count) {
    size_t i;
    for (i = 0; i < count; i++) {
        static const char untouched[9] = "ZZZZZZZZ";
        char *text = calloc(1, 1 << 20);
        const char *one = memcmp(&array[i], untouched, sizeof one) ? array[i] : NULL;
        if (!one || strlen(one) < (1 << 18)) put_hex(text, one);
        fprintf(file, "%s,", text);
        free(text);
    }
    fprintf(file, ";");
}

/* Loads the library; ends the process with status 4 if that is not possible. */
static void open_library(void) {
    library = dlopen(library_path, (bind_now ? RTLD_NOW : RTLD_LAZY) | RTLD_LOCAL);
    if (!library) { print("%s\n", dlerror()); fflush(out); _exit(4); }
}

/* Unloads the library. The output crashes if the library has set a buffer of the standard output that is unloaded with it. */
static __attribute__((unused)) void close_library(void) {
    dlclose(library);
    putchar('\n');
    fflush(stdout);
}

static void *function(const char *name) {
    void *found = dlsym(library, name);
    if (!found) { print("%s is not in the library\n", name); exit(3); }
    return found;
}

static __thread struct { void *map; size_t length; } *maps;
static __thread size_t arrays, capacity;

/* Allocates an array that ends at a guard page: an access beyond the array is a crash. */
static __attribute__((unused)) void *guarded(const void *bytes, size_t size) {
    size_t page = (size_t)sysconf(_SC_PAGESIZE), length = ((size + page - 1) / page + 2) * page;
    char *map = mmap(NULL, length, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (map == MAP_FAILED) { perror("mmap"); exit(3); }
    mprotect(map + length - page, page, PROT_NONE);
    char *array = map + length - page - size;
    memset(map, 0x5a, length - page);
    if (bytes) memcpy(array, bytes, size);
    if (arrays == capacity) maps = realloc(maps, (capacity = 2 * capacity + 64) * sizeof *maps);
    maps[arrays].map = map;
    maps[arrays++].length = length;
    return array;
}

/* Unmaps the arrays of a call: an FMU must not use them afterwards. */
static void release(size_t before) {
    while (arrays > before) { arrays--; munmap(maps[arrays].map, maps[arrays].length); }
}

/* Reports bytes that have changed before an array or in an array that is for reading. */
static __attribute__((unused)) void check_array(const void *array, const void *before, size_t size) {
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    const char *at = (const char *)((uintptr_t)array / page * page) - page;
    bool bad = before && memcmp(array, before, size) != 0;
    for (; at < (const char *)array; at++) bad |= *at != 0x5a;
    if (bad) { print(" (an array was damaged)"); fclose(results("damage", 0, "w")); }
}

/* Returns whether an observation of this kind was noted in a file. */
static __attribute__((unused)) bool noted(const char *kind) {
    char path[5100];
    snprintf(path, sizeof path, "%s/%s0", scratch, kind);
    return access(path, F_OK) == 0;
}

/* The address of this variable is the environment pointer of all instances, which the library must pass to the logger. */
static char environment_of_importer;

static void check_environment(const void *environment) {
    if (environment == &environment_of_importer) return;
    print("    the next message has another environment pointer\n");
    fclose(results("stray", 0, "w"));
}

/* Adds a message to `messages`, if there is room. */
static void record_message(int status, const char *category, const char *text) {
    size_t length = strlen(messages);
    if (length + 2 * (strlen(category ? category : "") + strlen(text ? text : "")) + 64 > sizeof messages) return;
    char *to = messages + length;
    to += sprintf(to, "%d ", status);
    to = put_hex(to, category);
    *to++ = ' ';
    to = put_hex(to, text);
    strcpy(to, ";");
}

static __attribute__((unused)) void logger2(void *environment, const char *name, int status, const char *category, const char *text, ...) {
    char whole[8000] = "";
    va_list list;
    check_environment(environment);
    va_start(list, text);
    if (text) vsnprintf(whole, sizeof whole, text, list);
    va_end(list);
    record_message(status, category, text ? whole : NULL);
    print("    log of %s: status %d, category %s: %s\n", name ? name : "NULL", status, category ? category : "NULL", whole);
}

static __attribute__((unused)) void logger3(void *environment, int status, const char *category, const char *text) {
    check_environment(environment);
    record_message(status, category, text);
    print("    log: status %d, category %s: %s\n", status, category ? category : "NULL", text ? text : "NULL");
}

static char resources[5000];
static __attribute__((unused)) Callbacks callbacks = {logger2, calloc, free, NULL, &environment_of_importer};

static void *copy(const char *text) { return guarded(text, strlen(text) + 1); }

static __attribute__((unused)) void *make(int index, const char *name, const char *token, bool co_simulation, bool logging, bool events, bool early) {
    size_t before = arrays;
    void *made;
    const char *location = copy(resources);
    name = copy(name);
    token = copy(token);
    *messages = 0;
    (void)events; (void)early;
#if FMI == 2
    made = ((void *(*)(const char *, int, const char *, const char *, const Callbacks *, int, int))function("fmi2Instantiate"))(name, co_simulation, token, location, &callbacks, 0, logging);
#else
    if (co_simulation)
        made = ((void *(*)(const char *, const char *, const char *, bool, bool, bool, bool, const uint32_t *, size_t, void *, void *, void *))function("fmi3InstantiateCoSimulation"))(name, token, location, false, logging, events, early, NULL, 0, &environment_of_importer, (void *)logger3, NULL);
    else
        made = ((void *(*)(const char *, const char *, const char *, bool, bool, void *, void *))function("fmi3InstantiateModelExchange"))(name, token, location, false, logging, &environment_of_importer, (void *)logger3);
#endif
    release(before);
    print("instance %d: %s\n", index, made ? "made" : "NULL");
    return made;
}

/* Opens the file for the results of a call, which are its status, the values that it wrote and its messages; writes the status. */
static __attribute__((unused)) FILE *begin(int number, int status) {
    FILE *file = results("r", number, "w");
    fprintf(file, "%d;", status);
    return file;
}

static __attribute__((unused)) void end(FILE *file, const char *log) {
    fputs(log, file);
    fclose(file);
}

static __attribute__((unused)) void version(int number, const char *name) {
    const char *text = ((const char *(*)(void))function(name))();
    FILE *file = results("r", number, "w");
    print("%s: %s\n", name, text);
    put_strings(file, &text, 1);
    fclose(file);
}

/* Prints values that a call wrote. The kind is f (floating-point), s (string), i (signed) or u (unsigned); the width is in bytes. */
static __attribute__((unused)) void show(const void *array, size_t count, char kind, size_t width) {
    size_t i;
    for (i = 0; i < count; i++) {
        const char *at = (const char *)array + i * width;
        if (kind == 'f' && width == 8) { double d; memcpy(&d, at, 8); print(" %.17g", d); }
        else if (kind == 'f') { float f; memcpy(&f, at, 4); print(" %.9g", (double)f); }
        else if (kind == 's') { const char *s; memcpy(&s, at, sizeof s); print(" \"%s\"", s ? s : "NULL"); }
        else {
            uint64_t word = 0, sign = UINT64_C(1) << (8 * width - 1);
            memcpy(&word, at, width);
            if (kind == 'u') print(" %llu", (unsigned long long)word);
            else print(" %lld", (long long)((word ^ sign) - sign));
        }
    }
}

/* Returns a pointer to the time of the next time event of an instance. */
static double *next_event(void *instance) {
    static struct { void *instance; double next; } known[64];
    size_t i;
    for (i = 0; i < 63 && known[i].instance && known[i].instance != instance; i++) {}
    if (!known[i].instance) known[i].next = INFINITY;
    known[i].instance = instance;
    return &known[i].next;
}

/* Updates the discrete states until no further update is needed, as an importer must before it leaves Event Mode. A flag that
   reports a change remains set if any of the updates has set it. */
#if FMI == 2
static __attribute__((unused)) int update_states(void *instance, void *info) {
    int32_t *flags = info, seen[5] = {0};
    int status, times = 0, i;
    do {
        status = ((int (*)(void *, void *))function("fmi2NewDiscreteStates"))(instance, info);
        for (i = 1; i < 4; i++) seen[i] |= flags[i] != 0;
    } while (status < 2 && flags[0] && ++times < 100);
    for (i = 1; i < 4; i++) if (status < 2 && times && seen[i]) memset(&flags[i], 1, 1);
    if (status < 2) *next_event(instance) = flags[4] ? *(double *)((char *)info + 24) : INFINITY;
    return status;
}
#else
static __attribute__((unused)) int update_states(void *instance, void *again, void *end, void *nominals, void *values, void *defined, void *next) {
    char *flags[5] = {again, end, nominals, values, defined}, seen[5] = {0};
    int status, times = 0, i;
    do {
        status = ((int (*)(void *, void *, void *, void *, void *, void *, void *))function("fmi3UpdateDiscreteStates"))(instance, again, end, nominals, values, defined, next);
        for (i = 1; i < 4; i++) seen[i] |= *flags[i] != 0;
    } while (status < 2 && *flags[0] && ++times < 100);
    for (i = 1; i < 4; i++) if (status < 2 && times && seen[i]) *flags[i] = 1;
    if (status < 2) *next_event(instance) = *flags[4] ? *(double *)next : INFINITY;
    return status;
}
#endif

static long entries(const char *path) {
    long count = 0;
    DIR *directory = opendir(path);
    while (directory && readdir(directory)) count++;
    if (directory) closedir(directory);
    return count;
}

extern char **environ;

/* Sets a seed in the first call. Later calls return whether the next random numbers still follow from it, even if the FMU has used
   some of them. */
static bool seed_is_kept(void) {
    static char own[128] __attribute__((aligned(16))), reference[128] __attribute__((aligned(16)));
    static bool seeded;
    long next[3], last[3], remaining = 5000000;
    char *current;
    int i;
    if (!seeded) { initstate(4711, own, sizeof own); return seeded = true; }
    current = initstate(4711, reference, sizeof reference);
    setstate(current);
    if (current != own) return false;
    for (i = 0; i < 3; i++) next[i] = random();
    setstate(reference);
    for (i = 0; i < 3; i++) last[i] = random();
    while (memcmp(next, last, sizeof last) && --remaining) { last[0] = last[1]; last[1] = last[2]; last[2] = random(); }
    setstate(own);
    return remaining > 0;
}

/* Writes the mask for new files, the number of files in the working directory, the priority, whether the seed was kept, the locale of
   the thread, limits, timers, standard streams and the environment. On Linux also writes the scheduling and the name of the thread. */
static void put_settings(FILE *file) {
    int limits[] = {RLIMIT_NOFILE, RLIMIT_STACK, RLIMIT_CPU, RLIMIT_CORE, RLIMIT_AS, RLIMIT_DATA, RLIMIT_FSIZE, RLIMIT_NPROC, RLIMIT_MEMLOCK};
    int timers[] = {ITIMER_REAL, ITIMER_VIRTUAL, ITIMER_PROF};
    size_t i;
    char **variable;
    mode_t mask = umask(0);
    umask(mask);
    fprintf(file, " %o %ld %d %d %p", (unsigned)mask, entries("."), getpriority(PRIO_PROCESS, 0), seed_is_kept(), (void *)uselocale((locale_t)0));
    for (i = 0; i < sizeof limits / sizeof *limits; i++) {
        struct rlimit limit;
        getrlimit(limits[i], &limit);
        fprintf(file, " %llu %llu", (unsigned long long)limit.rlim_cur, (unsigned long long)limit.rlim_max);
    }
    for (i = 0; i < 3; i++) {
        struct itimerval timer;
        /* The real timer runs because of the alarm of this program, so only its deviation from the alarm is a change. */
        double rest, off;
        getitimer(timers[i], &timer);
        rest = (double)timer.it_value.tv_sec + 1e-6 * (double)timer.it_value.tv_usec;
        off = i ? rest : fabs(rest - (alarm_ends - (double)time(NULL)));
        fprintf(file, " %d %ld.%ld", i ? rest != 0 : off > 3, (long)timer.it_interval.tv_sec, (long)timer.it_interval.tv_usec);
    }
    for (i = 0; i < 3; i++) {
        struct stat stream;
        fstat((int)i, &stream);
        fprintf(file, " %llu %x", (unsigned long long)stream.st_ino, (unsigned)fcntl((int)i, F_GETFL));
    }
#if defined(__linux__)
    {
        char name[20] = "";
        cpu_set_t cores;
        int timers_of_posix = 0, c;
        FILE *list = fopen("/proc/self/timers", "r");
        while (list && (c = fgetc(list)) != EOF) timers_of_posix += c == 'I';
        if (list) fclose(list);
        CPU_ZERO(&cores);
        sched_getaffinity(0, sizeof cores, &cores);
        prctl(PR_GET_NAME, name);
        fprintf(file, " %d %d %d %s", timers_of_posix, sched_getscheduler(0), CPU_COUNT(&cores), name);
    }
#endif
    for (variable = environ; variable && *variable; variable++) fprintf(file, " %s", *variable);
}

/* Writes the memory, threads and files of the process, and then its settings. */
static __attribute__((unused)) void measure(int number) {
    long pages = 0, all = 0, memory;
    char here[5000] = "";
    int signals[] = {SIGSEGV, SIGFPE, SIGINT, SIGABRT, SIGTERM, SIGHUP, SIGQUIT, SIGILL, SIGBUS, SIGPIPE, SIGALRM, SIGCHLD, SIGUSR1, SIGUSR2, SIGXCPU, SIGVTALRM, SIGPROF};
    size_t i;
    sigset_t blocked;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file) { if (fscanf(file, "%ld %ld", &all, &pages) != 2) pages = 0; fclose(file); }
    memory = pages * sysconf(_SC_PAGESIZE);
#if defined(__GLIBC__) && __GLIBC_PREREQ(2, 33)
    { struct mallinfo2 info = mallinfo2(); memory = (long)(info.uordblks + info.hblkhd); }
#endif
    print("memory: %ld bytes, threads: %ld, files: %ld\n", memory, entries("/proc/self/task"), entries("/proc/self/fd"));
    file = results("r", number, "w");
    fprintf(file, "%ld %ld %ld ;%s %s", memory, entries("/proc/self/task"), entries("/proc/self/fd"), setlocale(LC_ALL, NULL), getcwd(here, sizeof here) ? here : "");
    put_settings(file);
    for (i = 0; i < sizeof signals / sizeof *signals; i++) {
        struct sigaction action;
        sigaction(signals[i], NULL, &action);
        fprintf(file, " %p", (void *)action.sa_handler);
    }
    sigemptyset(&blocked);
    pthread_sigmask(SIG_BLOCK, NULL, &blocked);
    for (i = 1; i < 32; i++) fprintf(file, "%d", sigismember(&blocked, (int)i));
#if defined(__x86_64__)
    {
        unsigned short word;
        __asm__ volatile("fnstcw %0" : "=m"(word));
        fprintf(file, " %x %x", __builtin_ia32_stmxcsr() & ~0x3fu, word);
    }
#elif defined(__aarch64__)
    {
        unsigned long word;
        __asm__ volatile("mrs %0, fpcr" : "=r"(word));
        fprintf(file, " %lx", word);
    }
#endif
    fclose(file);
}

static __attribute__((unused)) long measured(int number, int index) {
    long numbers[3] = {0, 0, 0};
    if (sscanf(result("r", number), "%ld %ld %ld", &numbers[0], &numbers[1], &numbers[2]) != 3) exit(3);
    return numbers[index];
}

/* Writes the bytes of a serialized state to a file for the next process. */
static __attribute__((unused)) void pass_on(int number, const char *bytes, size_t size) {
    FILE *file = results("bytes", number, "wb");
    fwrite(bytes, 1, size, file);
    fclose(file);
}

/* Reads the bytes of a serialized state from the previous process; returns their number. */
static __attribute__((unused)) size_t *passed_on(int number, char *bytes) {
    FILE *file = results("bytes", number, "ab+");
    size_t *size = guarded(NULL, sizeof *size);
    rewind(file);
    *size = fread(bytes, 1, 1 << 24, file);
    fclose(file);
    return size;
}

