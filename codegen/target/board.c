/* The board: vectors, floating-point unit, SysTick as a counter, semihosting as a console.
 *
 * With `-icount shift=0` QEMU lets one instruction take 1 ns; SysTick counts at 25 MHz, so that one
 * tick is 40 instructions.
 */
#include "machine.h"

#define CPACR (*(volatile uint32_t *)0xE000ED88U)
#define SYST_CSR (*(volatile uint32_t *)0xE000E010U)
#define SYST_RVR (*(volatile uint32_t *)0xE000E014U)
#define SYST_CVR (*(volatile uint32_t *)0xE000E018U)

#define SYS_WRITE0 4
#define SYS_EXIT_EXTENDED 0x20
#define STOPPED 0x20026
#define PAINT 0xC0FFEE11U
#define PAINTED 4096U /* words below the stack pointer */

extern uint32_t stack_top;
void reset_handler(void);

__attribute__((section(".vectors"), used)) static const void *const vectors[2] = { &stack_top,
    (const void *)reset_handler };

static int semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void machine_print(const char *text)
{
    (void)semihosting(SYS_WRITE0, text);
}

void machine_start_clock(void)
{
    SYST_RVR = 0xFFFFFFU;
    SYST_CVR = 0U;
    SYST_CSR = 5U;
}

/* Instructions so far, in steps of 40; wraps. */
uint32_t machine_instructions(void)
{
    return (0xFFFFFFU - SYST_CVR) * 40U;
}

static uint32_t *below(void)
{
    uint32_t *sp;
    __asm__ volatile("mov %0, sp" : "=r"(sp));
    return sp - PAINTED;
}

__attribute__((noinline)) void machine_paint_stack(void)
{
    volatile uint32_t *word = below();
    uint32_t i;
    for (i = 0U; i < (PAINTED - 16U); i++) {
        word[i] = PAINT;
    }
}

__attribute__((noinline)) uint32_t machine_painted_stack_used(void)
{
    const volatile uint32_t *word = below();
    uint32_t i = 0U;
    while ((i < PAINTED) && (word[i] == PAINT)) {
        i++;
    }
    return (PAINTED - i) * 4U;
}

void reset_handler(void)
{
    uint32_t status[2] = { STOPPED, 0U };
    CPACR |= 0xFU << 20; /* the floating-point unit is off at reset */
    __asm__ volatile("dsb\n isb");
    status[1] = (uint32_t)main();
    (void)semihosting(SYS_EXIT_EXTENDED, status);
    for (;;) { }
}
