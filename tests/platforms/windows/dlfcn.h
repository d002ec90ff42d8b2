/* The part of POSIX dlfcn.h that fmu.h needs, for Windows. */
#ifndef PRW_TEST_DLFCN_H
#define PRW_TEST_DLFCN_H

#include <stdio.h>
#include <windows.h>

#define RTLD_NOW 0
#define RTLD_LOCAL 0
#define RTLD_NOLOAD 1

static inline const char *dlerror(void) {
    static char text[40];
    snprintf(text, sizeof text, "Windows error %lu", GetLastError());
    return text;
}

static inline void *dlopen(const char *path, int flags) {
    return flags & RTLD_NOLOAD ? GetModuleHandleA(path) : LoadLibraryA(path);
}

static inline void *dlsym(void *library, const char *name) { return (void *)GetProcAddress(library, name); }

static inline int dlclose(void *library) { return !FreeLibrary(library); }

#endif
