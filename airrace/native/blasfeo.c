/* Stand-ins for functions of blasfeo: Linux's dynamic linker takes the first function of a name that it finds, so fatrop
 * and blasfeo call these once this library is loaded for all others.
 *
 * Memory for matrices and vectors comes one after the other in chunks, instead of each in a piece of its own. fatrop
 * sets up all that it might ever need, every matrix three times over and once more for a restoration of feasibility,
 * and fills it with zeros; most of it is never written again. Chunks that are free are kept for the next solve, up to
 * `most_kept` bytes, so that their pages need not be fetched from the system again. Beyond `large` bytes in all, pages
 * that hold nothing but zeros are given back while further memory is asked for: such a page reads as zeros, and takes
 * no memory until it is written to.
 *
 * What is always written should share no page with what seldom is. fatrop asks for matrices of a stage one after the
 * other, then for those of the next stage, so chunks hold matrices of about one shape, and of two of the same shape the
 * second goes elsewhere.
 */

#define _GNU_SOURCE
#include "evaluator.h"

#include <pthread.h>
#include <sys/mman.h>
#include <unistd.h>

#define CHUNK ((size_t)1 << 22) /* a power of two: the chunk of an address is found by its upper bits */
#define PAGE ((size_t)4096)     /* a multiple of it may be the system's; then nothing is given back */
#define LINE ((size_t)64)       /* where matrices begin, as with blasfeo */
#define LOOK ((size_t)1 << 20)  /* so much is filled before zeros are looked for */

#define SHAPES 8
#define PLACES (2 * SHAPES + 1) /* the last one is for vectors */

#define NO_MEMORY 8 /* the exit code that `airrace/process.py` has for it */

/* At the beginning of every chunk. It is in the list of its place or in that of unused ones; `filled` bytes of it are
 * handed out, `seen` of them were looked at for zeros. */
struct chunk {
    struct chunk *next, *before;
    size_t size, filled, seen, pieces;
    int place;
};

/* what blasfeo says of a matrix or vector begins with the address of its memory */
struct piece {
    void *memory;
};

/* blasfeo's own functions, told by whoever loads this library */
struct blasfeo {
    size_t (*size_of_matrix)(int m, int n);
    size_t (*size_of_vector)(int m);
    void (*create_matrix)(int m, int n, struct piece *piece, void *memory);
    void (*create_vector)(int m, struct piece *piece, void *memory);
};

static struct blasfeo blasfeo;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct chunk *used[PLACES], *unused; /* the first of a place is being filled */
static int second[SHAPES];
static size_t mapped, kept, most, given_back;
static size_t large, most_kept; /* bytes */

static size_t rounded(size_t size, size_t unit) { return (size + unit - 1) / unit * unit; }

static struct chunk *chunk_of(void *memory) { return (struct chunk *)((uintptr_t)memory & ~(uintptr_t)(CHUNK - 1)); }

/* A chunk from the system, at a multiple of CHUNK. */
static struct chunk *fetched(size_t size)
{
    char *memory = mmap(0, size + CHUNK, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) return 0;
    char *begin = (char *)rounded((uintptr_t)memory, CHUNK);
    if (begin > memory) munmap(memory, begin - memory);
    const size_t behind = memory + CHUNK - begin;
    if (behind) munmap(begin + size, behind);
    mapped += size;
    return (struct chunk *)begin;
}

/* A chunk with several pieces goes before those that hold one. */
static void insert(struct chunk *chunk)
{
    struct chunk **first = used + chunk->place, *before = chunk->size > CHUNK ? *first : 0;
    chunk->before = before;
    chunk->next = before ? before->next : *first;
    if (chunk->next) chunk->next->before = chunk;
    if (before) before->next = chunk;
    else *first = chunk;
}

static void remove_used(struct chunk *chunk)
{
    if (chunk->next) chunk->next->before = chunk->before;
    if (chunk->before) chunk->before->next = chunk->next;
    else used[chunk->place] = chunk->next;
}

/* A chunk with room for so many bytes; one larger than CHUNK holds a single piece, whose address is within its first CHUNK. */
static struct chunk *fresh(size_t size, int place)
{
    const size_t whole = rounded(size + rounded(sizeof(struct chunk), LINE), CHUNK);
    struct chunk *chunk = unused;
    if (whole == CHUNK && chunk) {
        unused = chunk->next;
        kept -= CHUNK;
    } else if (!(chunk = fetched(whole)))
        return 0;
    *chunk = (struct chunk){.size = whole, .filled = rounded(sizeof(struct chunk), LINE), .place = place};
    insert(chunk);
    if (mapped - kept > most) most = mapped - kept;
    return chunk;
}

static int is_zero(const char *page)
{
    const uint64_t *words = (const uint64_t *)page;
    uint64_t any = 0;
    for (size_t i = 0; i < PAGE / sizeof(uint64_t); i++) any |= words[i];
    return !any;
}

/* Give back the pages of a chunk that are full and hold nothing but zeros. */
static void give_back(struct chunk *chunk)
{
    char *begin = (char *)chunk;
    size_t from = chunk->seen ? chunk->seen / PAGE * PAGE : PAGE;
    const size_t end = chunk->filled / PAGE * PAGE;
    while (from < end) {
        size_t to = from;
        while (to < end && is_zero(begin + to)) to += PAGE;
        if (to > from && madvise(begin + from, to - from, MADV_DONTNEED) == 0) given_back += to - from;
        from = to + PAGE;
    }
    chunk->seen = chunk->filled;
}

/* The same of a place's chunks with more than so much that was not looked at; behind one without all were. */
static void give_back_unseen(int place, size_t much)
{
    for (struct chunk *one = used[place]; one; one = one->next) {
        if (one->filled - one->seen > much) give_back(one);
        else if (one != used[place]) return;
    }
}

static void discard(struct chunk *chunk)
{
    remove_used(chunk);
    if (chunk->size == CHUNK && kept + CHUNK <= most_kept) {
        chunk->next = unused;
        unused = chunk;
        kept += CHUNK;
        return;
    }
    mapped -= chunk->size;
    munmap(chunk, chunk->size);
}

/* So much memory. What was handed out before has been filled with zeros by now. */
static void *piece_of(size_t size, int place)
{
    size = rounded(size ? size : 1, LINE);
    pthread_mutex_lock(&lock);
    if (place < 2 * SHAPES && (second[place / 2] = !second[place / 2])) place++;
    struct chunk *chunk = used[place];
    const int full = !chunk || chunk->size - chunk->filled < size;
    if (mapped - kept > large) give_back_unseen(place, full ? 0 : LOOK);
    if (full) chunk = fresh(size, place);
    if (!chunk) _exit(NO_MEMORY); /* fatrop takes no refusal */
    void *memory = (char *)chunk + chunk->filled;
    chunk->filled += size;
    chunk->pieces++;
    pthread_mutex_unlock(&lock);
    return memory;
}

static void give_up(struct piece *piece)
{
    if (!piece->memory) return;
    pthread_mutex_lock(&lock);
    struct chunk *chunk = chunk_of(piece->memory);
    if (!--chunk->pieces) discard(chunk);
    pthread_mutex_unlock(&lock);
}

EXPORT void arena_begin(const struct blasfeo *functions, size_t large_bytes, size_t kept_bytes)
{
    blasfeo = *functions;
    large = large_bytes;
    most_kept = kept_bytes;
}

EXPORT void blasfeo_allocate_dmat(int m, int n, struct piece *piece)
{
    blasfeo.create_matrix(m, n, piece, piece_of(blasfeo.size_of_matrix(m, n), n % SHAPES * 2));
}

EXPORT void blasfeo_allocate_dvec(int m, struct piece *piece)
{
    blasfeo.create_vector(m, piece, piece_of(blasfeo.size_of_vector(m), PLACES - 1));
}

EXPORT void blasfeo_free_dmat(struct piece *piece) { give_up(piece); }

EXPORT void blasfeo_free_dvec(struct piece *piece) { give_up(piece); }

/* Bytes that are mapped and not kept for later, the most that ever were, and all that were given back. */
EXPORT void arena_use(size_t numbers[3])
{
    numbers[0] = mapped - kept;
    numbers[1] = most;
    numbers[2] = given_back;
}

/* The products of products.c under blasfeo's names. */

static const struct evaluator *chosen;

EXPORT void products_begin(const struct evaluator *evaluator)
{
    chosen = evaluator;
}

EXPORT void kernel_dgemm_nt_4x4_lib4(
    int kmax, const double *alpha, const double *A, const double *B, const double *beta, const double *C, double *D)
{
    chosen->gemm_nt(kmax, alpha, A, B, beta, C, D);
}

EXPORT void kernel_dgemv_n_4_lib4(
    int kmax, const double *alpha, const double *A, const double *x, const double *beta, const double *y, double *z)
{
    chosen->gemv_n(kmax, alpha, A, x, beta, y, z);
}

EXPORT void kernel_dgemv_t_4_lib4(
    int kmax, const double *alpha, int offset, const double *A, int width, const double *x, const double *beta,
    const double *y, double *z)
{
    chosen->gemv_t(kmax, alpha, offset, A, width, x, beta, y, z);
}
