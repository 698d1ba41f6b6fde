/* The translation of a function's operations from casadi's order to the interpreter's, see interpreter.py. */
#include <stdlib.h>

#include "evaluator.h"
#include "operations.h"

#define OPERATION(operation, expression) operation,
enum operation { ON_VECTORS(OPERATION) BY_LANE(OPERATION) OPERATIONS };

/* Rows of other kinds: variable `to` gets the number of place `a`; the number of variable `a` belongs to place `to`. */
enum { LOAD = -1, STORE = -2 };

/* An operation. Its arguments are places below `fixed` (of constants, arguments and results) or other operations behind
 * them. The operations that use it are a list: of 2 * i + k the next one is step i's next[k], the last one is -1. */
struct step {
    int32_t kind, argument[2], users, next[2], missing, last, place, stays;
};

/* Operations of one kind that could follow, the first one on top, and since when there are any. */
struct heap {
    int32_t *numbers, count, since;
};

static void push(struct heap *heap, int32_t number)
{
    int32_t at = heap->count++;
    for (int32_t above; at && heap->numbers[above = (at - 1) / 2] > number; at = above)
        heap->numbers[at] = heap->numbers[above];
    heap->numbers[at] = number;
}

static int32_t pop(struct heap *heap)
{
    const int32_t top = heap->numbers[0], number = heap->numbers[--heap->count];
    int32_t at = 0;
    for (int32_t below; (below = 2 * at + 1) < heap->count; at = below) {
        if (below + 1 < heap->count && heap->numbers[below + 1] < heap->numbers[below]) below++;
        if (heap->numbers[below] > number) break;
        heap->numbers[at] = heap->numbers[below];
    }
    heap->numbers[at] = number;
    return top;
}

/* Read the rows (kind, a, b, to); return the number of operations. Copies are results (to, from) computed elsewhere. */
static int32_t read(
    int64_t count, int32_t fixed, const int32_t (*rows)[4], int32_t *holds, struct step *steps, int32_t (*copies)[2],
    int32_t *copied)
{
    int32_t operations = 0;
    for (const int32_t(*row)[4] = rows; row < rows + count; row++) {
        const int32_t kind = (*row)[0], a = (*row)[1], b = (*row)[2], to = (*row)[3];
        if (kind == LOAD) {
            holds[to] = a;
        } else if (kind == STORE) {
            struct step *step = holds[a] < fixed ? NULL : steps + holds[a] - fixed;
            if (step && !step->stays) {
                step->place = to;
                step->stays = 1;
            } else {
                copies[*copied][0] = to;
                copies[(*copied)++][1] = step ? step->place : holds[a];
            }
        } else {
            steps[operations] = (struct step){.kind = kind, .argument = {holds[a], holds[b]}, .users = -1};
            holds[to] = fixed + operations++;
        }
    }
    for (int32_t i = operations - 1; i >= 0; i--) /* so that lists ascend */
        for (int k = 0; k < 2; k++) {
            const int32_t number = steps[i].argument[k];
            if (number < fixed || (k && number == steps[i].argument[0])) continue;
            steps[i].next[k] = steps[number - fixed].users;
            steps[number - fixed].users = 2 * i + k;
            steps[i].missing++;
        }
    return operations;
}

/* Bring steps into an order in which each follows those that it depends on, in runs of one kind; return the number of
 * runs. Of the steps that could follow, the kind with the most is taken, for as long as there are any of it. */
static int32_t group(int32_t operations, struct step *steps, int32_t *numbers, int32_t *order, int32_t *runs)
{
    struct heap heaps[OPERATIONS] = {0};
    int32_t clock = 0, found = 0, size[OPERATIONS] = {0};
    for (int32_t i = 0; i < operations; i++) size[steps[i].kind]++;
    for (int kind = 0; kind < OPERATIONS; numbers += size[kind++]) heaps[kind].numbers = numbers;
    for (int32_t i = 0; i < operations; i++) {
        if (steps[i].missing) continue;
        struct heap *heap = heaps + steps[i].kind;
        if (!heap->count) heap->since = ++clock;
        push(heap, i);
    }
    for (int32_t done = 0; done < operations; found++) {
        struct heap *heap = heaps;
        for (struct heap *other = heaps + 1; other < heaps + OPERATIONS; other++)
            if (other->count > heap->count || (other->count == heap->count && other->since < heap->since)) heap = other;
        const int32_t begin = done;
        for (; heap->count && done - begin < UINT16_MAX; done++) {
            const int32_t number = order[done] = pop(heap);
            for (int32_t use = steps[number].users; use >= 0; use = steps[use / 2].next[use % 2]) {
                struct step *user = steps + use / 2;
                if (--user->missing) continue;
                struct heap *others = heaps + user->kind;
                if (!others->count && others != heap) others->since = ++clock;
                push(others, use / 2);
            }
        }
        runs[found] = done - begin;
    }
    return found;
}

/* Write the instructions of `count` rows, up to 2 * count + 2, and the number of places; return how many, or -1 for lack
 * of memory. A result is computed where it belongs; what lies between takes a place that is free after its last use. */
EXPORT int64_t airrace_translate(
    int64_t count, int64_t variables, int32_t fixed, const int32_t (*rows)[4], uint16_t (*code)[3], int32_t *places)
{
    struct step *steps = malloc((count + 1) * sizeof *steps);
    int32_t *memory = malloc((variables + 6 * count + 1) * sizeof *memory);
    int64_t written = -1;
    if (steps && memory) {
        int32_t *holds = memory, *numbers = holds + variables, *order = numbers + count, *runs = order + count;
        int32_t *unused = runs + count, (*copies)[2] = (void *)(unused + count), copied = 0, free_places = 0;
        const int32_t operations = read(count, fixed, rows, holds, steps, copies, &copied);
        const int32_t found = group(operations, steps, numbers, order, runs);
        for (int32_t time = 0; time < operations; time++)
            for (int k = 0; k < 2; k++) {
                const int32_t number = steps[order[time]].argument[k];
                if (number >= fixed) steps[number - fixed].last = time;
            }
        *places = fixed;
        written = 0;
#define WRITE(to, a, b)                                                                                               \
    (code[written][0] = (uint16_t)(to), code[written][1] = (uint16_t)(a), code[written++][2] = (uint16_t)(b))
        for (int32_t run = 0, time = 0; run < found; run++) {
            WRITE(steps[order[time]].kind, runs[run], 0);
            for (const int32_t end = time + runs[run]; time < end; time++) {
                struct step *step = steps + order[time];
                int32_t from[2];
                for (int k = 0; k < 2; k++) {
                    const int32_t number = step->argument[k];
                    const struct step *before = number < fixed ? NULL : steps + number - fixed;
                    from[k] = before ? before->place : number;
                    if (before && before->last == time && !before->stays && !(k && number == step->argument[0]))
                        unused[free_places++] = before->place;
                }
                if (!step->stays) step->place = free_places ? unused[--free_places] : (*places)++;
                WRITE(step->place, from[0], from[1]);
            }
        }
        if (copied) WRITE(ASSIGN, copied, 0);
        for (int32_t i = 0; i < copied; i++) WRITE(copies[i][0], copies[i][1], copies[i][1]);
        WRITE(OPERATIONS, 0, 0);
    }
    free(memory);
    free(steps);
    return written;
}
