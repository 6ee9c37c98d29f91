/* A machine with an operating system: it prints, and counts nothing. */
#include "machine.h"

#include <stdio.h>

void machine_print(const char *text)
{
    (void)fputs(text, stdout);
}

void machine_start_clock(void)
{
}

uint32_t machine_instructions(void)
{
    return 0U;
}

void machine_paint_stack(void)
{
}

uint32_t machine_painted_stack_used(void)
{
    return 0U;
}
