/* The reader of a kernel's tables: integers, instructions and constants, one behind the other, and working memory.
 *
 * With `memory` null nothing is handed out, and `used` tells how much would be.
 */
#ifndef AIRRACE_TABLES_H
#define AIRRACE_TABLES_H

#include <stddef.h>
#include <stdint.h>

#include "lanes.h"

/* number[to] = operation(number[a], number[b]); before each run of one operation stand its number (`to`) and the length
 * of the run (`a`) */
struct instruction {
    uint16_t to, a, b;
};

struct reader {
    const int *tables; /* each behind its length */
    const struct instruction *code;
    const double *constants;
    real *memory;
    size_t used; /* vectors of the memory */
};

INLINE const int *read_table(struct reader *reader)
{
    const int *table = reader->tables + 1;
    reader->tables = table + table[-1];
    return table;
}

INLINE const struct instruction *read_code(struct reader *reader, int count)
{
    const struct instruction *code = reader->code;
    reader->code += count;
    return code;
}

INLINE const double *read_constants(struct reader *reader, int count)
{
    const double *constants = reader->constants;
    reader->constants += count;
    return constants;
}

INLINE real *allocate(struct reader *reader, size_t count)
{
    real *begin = reader->memory ? reader->memory + reader->used : NULL;
    reader->used += count;
    return begin;
}

#endif
