/* The reading of tables, which stand one after another, each behind its length. */

#include <stdint.h>

/* where the next table, list of instructions, list of constants and function begin, and the next free memory */
struct reader {
    const int *tables;
    const struct instruction *code;
    const double *numbers;
    real *memory;
    int functions;
};

static const int *table(struct reader *from)
{
    const int *found = from->tables + 1;
    from->tables = found + found[-1];
    return found;
}

static const double *numbers(struct reader *from, int count)
{
    return (from->numbers += count) - count;
}

static real *room(struct reader *from, integer count)
{
    return (from->memory += count) - count;
}

/* plain loops over numbers */

static void copy(const real *from, int size, real *to)
{
    for (int i = 0; i < size; i++) to[i] = from[i];
}

static void clear(real *to, int size)
{
    for (int i = 0; i < size; i++) to[i] = all(0.0);
}
