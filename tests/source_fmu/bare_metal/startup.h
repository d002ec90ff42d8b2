/* Functions of startup.c. */
#ifndef STARTUP_H
#define STARTUP_H

#include <stdbool.h>
#include <stddef.h>

/* Memory for one instance of the testbed, in bytes. */
#define MEMORY (288u * 1024u)

/* Bytes that were allocated. */
extern size_t allocated;
/* From now on, an allocation is a fault. */
extern bool is_started;

/* Returns how many bytes of the stack have been used. */
size_t used_stack(void);
void print(const char *text);
__attribute__((noreturn)) void stop(int status);

#endif
