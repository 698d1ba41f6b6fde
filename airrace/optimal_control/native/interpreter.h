/* Straight-line functions, read from tables: lists of elementary operations, see interpreter.py. */
#ifndef AIRRACE_INTERPRETER_H
#define AIRRACE_INTERPRETER_H

#include <stddef.h>
#include <stdint.h>

#include "lanes.h"

#define interpret VARIANT_NAME(interpret)
#define call VARIANT_NAME(call)

/* The reader of a kernel's tables: integers, instructions and constants, one behind the other, and working memory.
 *
 * With `memory` null nothing is handed out, and `used` tells how much would be. */

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

/* A function has up to four arguments, of which the third is shared by all intervals, and up to two results. Its numbers
 * are constants, arguments, results and intermediate values, in this order. */
enum { ARGUMENTS = 4, SHARED = 2, RESULTS = 2 };

struct function {
    const struct instruction *code;
    const int *argument, *argument_size, *result, *result_size;
    int constants;
    const double *constant;
    real *number;
};

INLINE struct function read_function(struct reader *reader)
{
    struct function function;
    const int *size = read_table(reader); /* instructions, constants, numbers */
    function.argument = read_table(reader);
    function.argument_size = read_table(reader);
    function.result = read_table(reader);
    function.result_size = read_table(reader);
    function.code = read_code(reader, size[0]);
    function.constants = size[1];
    function.constant = read_constants(reader, size[1]);
    function.number = allocate(reader, size[2]);
    return function;
}

/* Write the constants and the shared argument, once before all calls. */
INLINE void prepare(const struct function *function, const double *shared)
{
    for (int i = 0; i < function->constants; i++) function->number[i] = broadcast(function->constant[i]);
    real *argument = function->number + function->argument[SHARED];
    for (int i = 0; i < function->argument_size[SHARED]; i++) argument[i] = broadcast(shared[i]);
}

void interpret(const struct instruction *at, real *number);

/* Evaluate; null arguments keep their values, null results are not copied. */
void call(const struct function *function, const real *const given[ARGUMENTS], real *const found[RESULTS]);

#endif
