/*
 * A Cortex-M on QEMU's boards mps2-an386 (M4F) and mps2-an500 (M7), without a C library's start: vectors, memory, and
 * semihosting for files and text. With `-icount shift=0` an instruction takes 1 ns of the board's time, and the system
 * timer counts at 25 MHz, so a tick is 40 instructions.
 */
#include <stdint.h>
#include <string.h>

#define NAME "samples.bin"
#define SYS_OPEN 0x01
#define SYS_WRITE0 0x04
#define SYS_READ 0x06
#define SYS_EXIT 0x18
#define STOPPED_NORMALLY 0x20026
#define STOPPED_BY_ERROR 0x20023
#define TIMER_MASK 0xffffffU

#define REGISTER(address) (*(volatile uint32_t *)(address))

int main(void);
void start(void);
void platform_open(void);
int platform_read(void *into, uint32_t bytes);
void platform_print(const char *text);
uint32_t platform_ticks(void);
uint32_t platform_ticks_between(uint32_t from, uint32_t to);
uint32_t platform_instructions_per_tick(void);

extern uint32_t stack_top, data_from, data_begin, data_end, bss_begin, bss_end;

static uintptr_t file;

static uintptr_t semihost(uintptr_t operation, const void *argument)
{
    register uintptr_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void platform_open(void)
{
    const uintptr_t block[3] = { (uintptr_t)NAME, 1U, sizeof NAME - 1U };
    file = semihost(SYS_OPEN, block);
    REGISTER(0xe000e014U) = TIMER_MASK;
    REGISTER(0xe000e018U) = 0U;
    REGISTER(0xe000e010U) = 5U;
}

int platform_read(void *into, uint32_t bytes)
{
    const uintptr_t block[3] = { file, (uintptr_t)into, bytes };
    return semihost(SYS_READ, block) == 0U;
}

void platform_print(const char *text)
{
    (void)semihost(SYS_WRITE0, text);
}

uint32_t platform_ticks(void)
{
    return REGISTER(0xe000e018U);
}

/* The timer counts down and begins again. */
uint32_t platform_ticks_between(uint32_t from, uint32_t to)
{
    return (from - to) & TIMER_MASK;
}

uint32_t platform_instructions_per_tick(void)
{
    return 40U;
}

static void fault(void)
{
    (void)semihost(SYS_WRITE0, "the core reports a fault\n");
    (void)semihost(SYS_EXIT, (const void *)STOPPED_BY_ERROR);
}

void start(void)
{
    /* The floating-point unit is off after a reset. */
    REGISTER(0xe000ed88U) |= 0xfU << 20;
    __asm__ volatile("dsb\n isb");
    (void)memcpy(&data_begin, &data_from, (size_t)((char *)&data_end - (char *)&data_begin));
    (void)memset(&bss_begin, 0, (size_t)((char *)&bss_end - (char *)&bss_begin));
    (void)semihost(SYS_EXIT, (const void *)(main() == 0 ? STOPPED_NORMALLY : STOPPED_BY_ERROR));
}

__attribute__((section(".vectors"), used)) static const void *const vectors[16] = { &stack_top, (const void *)start,
    (const void *)fault, (const void *)fault, (const void *)fault, (const void *)fault, (const void *)fault };
