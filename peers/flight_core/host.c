/* The host: standard input and output, and no counter. */
#include <stdint.h>
#include <stdio.h>

void platform_open(void);
int platform_read(void *into, uint32_t bytes);
void platform_print(const char *text);
uint32_t platform_ticks(void);
uint32_t platform_ticks_between(uint32_t from, uint32_t to);
uint32_t platform_instructions_per_tick(void);

void platform_open(void) {}
int platform_read(void *into, uint32_t bytes) { return fread(into, 1, bytes, stdin) == bytes; }
void platform_print(const char *text) { fputs(text, stdout); }
uint32_t platform_ticks(void) { return 0; }
uint32_t platform_ticks_between(uint32_t from, uint32_t to) { return to - from; }
uint32_t platform_instructions_per_tick(void) { return 0; }
