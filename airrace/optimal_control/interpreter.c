/* The evaluation of any model's functions from tables, on vectors that hold one number of each of LANES intervals.
 *
 * A function is a list of elementary operations, see bytecode.py. Operations of one kind stand together as far as their
 * arguments allow: a processor that guesses for every single one what comes next guesses wrongly too often.
 *
 * Before this text stand lanes.h, the lists of all operations (ON_VECTORS and LANE_AFTER_LANE, see machine.py) and
 * tables.h.
 */

/* Places of numbers: to = a OPERATION b. Before each run of one operation stand its kind and how often it follows. */
struct instruction {
    uint16_t to, a, b;
};

/* A function of up to four arguments, of which the third is what all intervals share, and up to two results. Its
 * numbers are, one after another, constants, arguments, results and what lies between. */
enum { ARGUMENTS = 4, SHARED = 2, RESULTS = 2 };
struct function {
    const struct instruction *code;
    const int *argument, *argument_size, *result, *result_size;
    int constants, numbers;
    const double *constant;
    real *number;
};

static struct function function(struct reader *from)
{
    struct function of;
    const int *size = table(from);
    of.constants = size[1];
    of.numbers = size[2];
    of.argument = table(from);
    of.argument_size = table(from);
    of.result = table(from);
    of.result_size = table(from);
    of.code = from->code;
    from->code += size[0];
    of.constant = numbers(from, of.constants);
    of.number = room(from, of.numbers);
    return of;
}

static void copy_to_all(const double *from, int size, real *to)
{
    for (int i = 0; i < size; i++) to[i] = all(from[i]);
}

/* once, before all calls */
static void begin(const struct function *function, const double *shared)
{
    copy_to_all(function->constant, function->constants, function->number);
    copy_to_all(shared, function->argument_size[SHARED], function->number + function->argument[SHARED]);
}

#define NEXT                                                                                                          \
    left = at->a;                                                                                                     \
    goto *label[(at++)->to]
#define REPEATED(name, expression)                                                                                    \
    name:                                                                                                             \
    for (; left; left--, at++) {                                                                                      \
        const real x = number[at->a], y = number[at->b];                                                              \
        (void)y;                                                                                                      \
        number[at->to] = expression;                                                                                  \
    }                                                                                                                 \
    NEXT;
#define REPEATED_BY_LANE(name, expression)                                                                            \
    name:                                                                                                             \
    for (; left; left--, at++)                                                                                        \
        for (int lane = 0; lane < LANES; lane++) {                                                                    \
            const double a = number[at->a][lane], b = number[at->b][lane];                                            \
            (void)b;                                                                                                  \
            number[at->to][lane] = expression;                                                                        \
        }                                                                                                             \
    NEXT;
#define LABEL(name, expression) &&name,

static void interpret(const struct instruction *at, real *number)
{
    static const void *const label[] = {ON_VECTORS(LABEL) LANE_AFTER_LANE(LABEL) &&done};
    int left;
    NEXT;
    ON_VECTORS(REPEATED)
    LANE_AFTER_LANE(REPEATED_BY_LANE)
    done:;
}

/* the results of a function; those that are null are not asked for, and arguments that are null are what they were */
static void call(const struct function *function, const real *const given[ARGUMENTS], real *const found[RESULTS])
{
    real *number = function->number;
    for (int k = 0; k < ARGUMENTS; k++)
        if (given[k]) copy(given[k], function->argument_size[k], number + function->argument[k]);
    interpret(function->code, number);
    for (int k = 0; k < RESULTS; k++)
        if (found[k]) copy(number + function->result[k], function->result_size[k], found[k]);
}
