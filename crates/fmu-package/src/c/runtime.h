/* Runtime for C code that wasm2c generates from a WebAssembly module: its memory and its instructions.
   Unlike wasm2c's own runtime, it does not use signals, mmap or allocation, and a trap ends only the call in which it occurs. */
#ifndef FMU_RUNTIME_H
#define FMU_RUNTIME_H

#include <assert.h>
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

/* Results are bit-identical everywhere, because operations keep the order of the code and each one rounds to its type. */
#if defined(__FAST_MATH__) || defined(_M_FP_FAST) || defined(__ASSOCIATIVE_MATH__) || \
    defined(__RECIPROCAL_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "compile without -ffast-math (/fp:fast): the results would differ from the model's"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0
#error "the compiler calculates with more digits than double has: add -msse2 -mfpmath=sse"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

#if defined(__BIG_ENDIAN__) || (defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__)
#error "the module's memory is little-endian, this processor is not"
#endif

/* FMU_INLINE is for the accesses to memory, of which a step makes hundreds: as calls, they take as many instructions as all others. */
#ifdef __GNUC__
#define UNLIKELY(x) __builtin_expect(!!(x), 0)
#define FMU_NO_RETURN __attribute__((noreturn, cold))
#define FMU_INLINE __attribute__((always_inline)) static inline
#else
#define UNLIKELY(x) (x)
#define FMU_NO_RETURN
#endif
#ifdef _MSC_VER
#define inline __inline
#define FMU_INLINE static __forceinline
#endif
#ifndef FMU_INLINE
#define FMU_INLINE static inline
#endif

/* Reasons of a trap. */
enum {
    WASM_RT_TRAP_OOB = 1,
    WASM_RT_TRAP_INT_OVERFLOW,
    WASM_RT_TRAP_DIV_BY_ZERO,
    WASM_RT_TRAP_INVALID_CONVERSION,
    WASM_RT_TRAP_UNREACHABLE,
    WASM_RT_TRAP_CALL_INDIRECT
};

/* An instance contains all memory that its module can request. FMU_SMALL unused bytes follow it, so that only
   the base of an address must be checked if the offset is smaller than FMU_SMALL. */
#define FMU_PAGE 65536u
#define FMU_MEMORY (FMU_MEMORY_PAGES * FMU_PAGE)
#define FMU_SMALL 4096u

#if FMU_MEMORY_PAGES <= FMU_INITIAL_PAGES || FMU_MEMORY_PAGES > 16384
#error "FMU_MEMORY_PAGES, the memory of an instance in units of 64 KiB, is less than the module needs or over 1 GiB"
#endif

/* Adds the memory size to the name of a function, so that files that were compiled with different sizes do not link. */
#define FMU_JOIN(name, number) name##_##number
#define FMU_WITH_MEMORY(name, pages) FMU_JOIN(name, pages)

typedef struct {
    uint64_t pages;
    bool is_full;  /* whether the module has requested more memory than there is */
    jmp_buf *trap; /* target of the jump if the running call traps */
    int reason;    /* reason of the trap */
    union {
        double aligned;
        uint8_t bytes[FMU_MEMORY + FMU_SMALL];
    } data;
} wasm_rt_memory_t;

typedef void (*wasm_rt_function_ptr_t)(void);
typedef const char *wasm_rt_func_type_t;
typedef struct {
    void *fn;
} wasm_rt_tailcallee_t;

typedef struct {
    wasm_rt_func_type_t func_type;
    wasm_rt_function_ptr_t func;
    void *module_instance;
} wasm_rt_funcref_t;

typedef struct {
    wasm_rt_funcref_t data[FMU_TABLE];
} wasm_rt_funcref_table_t;

typedef enum { RefFunc } wasm_elem_segment_expr_type_t;
typedef struct {
    wasm_elem_segment_expr_type_t expr_type;
    wasm_rt_func_type_t type;
    wasm_rt_function_ptr_t func;
    wasm_rt_tailcallee_t func_tailcallee;
    size_t module_offset;
} wasm_elem_segment_expr_t;

#define FUNC_TYPE_T(x) static const char *const x
#define FUNC_PROLOGUE
#define FUNC_EPILOGUE
#define WASM_RT_USE_SEGUE_FOR_THIS_MODULE 0

FMU_NO_RETURN static inline void wasm_rt_trap(wasm_rt_memory_t *memory, int reason) {
    memory->reason = reason;
    longjmp(*memory->trap, 1);
}

#define TRAP(why) (wasm_rt_trap(&instance->w2c_memory, WASM_RT_TRAP_##why), 0)
#define UNREACHABLE wasm_rt_trap(&instance->w2c_memory, WASM_RT_TRAP_UNREACHABLE)

/* Memory and tables are parts of the instance, which calloc fills with zeros, so they need no allocation here. */

#define wasm_rt_is_initialized() true

static inline uint64_t wasm_rt_grow_memory(wasm_rt_memory_t *memory, uint64_t pages) {
    uint64_t before = memory->pages;
    if (pages > FMU_MEMORY_PAGES - before) {
        memory->is_full = true;
        return 0xffffffffu;
    }
    memory->pages += pages;
    return before;
}

static inline void wasm_rt_allocate_memory(wasm_rt_memory_t *memory, uint64_t initial, uint64_t most, bool is64,
                                           uint32_t page) {
    (void)most, (void)is64, (void)page;
    wasm_rt_grow_memory(memory, initial);
}

static inline void wasm_rt_free_memory(wasm_rt_memory_t *memory) {
    (void)memory;
}

static inline void wasm_rt_allocate_funcref_table(wasm_rt_funcref_table_t *table, uint32_t size, uint32_t most) {
    (void)table, (void)size, (void)most;
}

static inline void wasm_rt_free_funcref_table(wasm_rt_funcref_table_t *table) {
    (void)table;
}

static inline void funcref_table_init(wasm_rt_funcref_table_t *table, const wasm_elem_segment_expr_t *from,
                                      uint32_t length, uint64_t at, uint32_t first, uint32_t count, void *instance) {
    uint32_t i;
    (void)length;
    for (i = 0; i < count; i++) {
        wasm_rt_funcref_t *to = &table->data[at + i];
        to->func_type = from[first + i].type;
        to->func = from[first + i].func;
        to->module_instance = (char *)instance + from[first + i].module_offset;
    }
}

/* Function types are compared by pointer, because there is only one module and it has one string for each type. */
#define CALL_INDIRECT(table, function, type, i, ...)                                        \
    ((void)(UNLIKELY((i) >= FMU_TABLE || (table).data[i].func_type != (type)) ? TRAP(CALL_INDIRECT) : 0), \
     ((function)(table).data[i].func)(__VA_ARGS__))

#define LOAD_DATA(memory, at, from, count) memcpy(&(memory).data.bytes[at], from, count)

#define FMU_CHECK(memory, at, length)                           \
    if (UNLIKELY((uint64_t)(at) + (length) > FMU_MEMORY)) {     \
        wasm_rt_trap(memory, WASM_RT_TRAP_OOB);                 \
    }

static inline void memory_fill(wasm_rt_memory_t *memory, uint32_t at, uint32_t value, uint32_t count) {
    FMU_CHECK(memory, at, count)
    memset(&memory->data.bytes[at], (int)(value & 0xff), count);
}

static inline void memory_copy(wasm_rt_memory_t *memory, const wasm_rt_memory_t *same, uint32_t to, uint32_t from,
                               uint32_t count) {
    (void)same;
    FMU_CHECK(memory, to, count)
    FMU_CHECK(memory, from, count)
    memmove(&memory->data.bytes[to], &memory->data.bytes[from], count);
}

/* Returns a pointer to `length` bytes. `offset` is a constant, so the compiler evaluates the conditions on it. */
FMU_INLINE uint8_t *fmu_at(wasm_rt_memory_t *memory, uint32_t base, uint32_t offset, uint32_t length) {
    if (UNLIKELY(offset <= FMU_SMALL - length ? base >= FMU_MEMORY : (uint64_t)base + offset + length > FMU_MEMORY)) {
        wasm_rt_trap(memory, WASM_RT_TRAP_OOB);
    }
    return &memory->data.bytes[(size_t)base + offset];
}

#define FMU_LOAD(name, stored, extended, result)                                             \
    FMU_INLINE result name(wasm_rt_memory_t *memory, uint32_t base, uint32_t offset) {       \
        stored value;                                                                        \
        memcpy(&value, fmu_at(memory, base, offset, sizeof value), sizeof value);            \
        return (result)(extended)value;                                                      \
    }

#define FMU_STORE(name, stored, given)                                                                \
    FMU_INLINE void name(wasm_rt_memory_t *memory, uint32_t base, uint32_t offset, given whole) {     \
        stored value = (stored)whole;                                                                 \
        memcpy(fmu_at(memory, base, offset, sizeof value), &value, sizeof value);                     \
    }

FMU_LOAD(i32_load, uint32_t, uint32_t, uint32_t)
FMU_LOAD(i32_load8_s, int8_t, int32_t, uint32_t)
FMU_LOAD(i32_load8_u, uint8_t, uint32_t, uint32_t)
FMU_LOAD(i32_load16_s, int16_t, int32_t, uint32_t)
FMU_LOAD(i32_load16_u, uint16_t, uint32_t, uint32_t)
FMU_LOAD(i64_load, uint64_t, uint64_t, uint64_t)
FMU_LOAD(i64_load8_s, int8_t, int64_t, uint64_t)
FMU_LOAD(i64_load8_u, uint8_t, uint64_t, uint64_t)
FMU_LOAD(i64_load16_s, int16_t, int64_t, uint64_t)
FMU_LOAD(i64_load16_u, uint16_t, uint64_t, uint64_t)
FMU_LOAD(i64_load32_s, int32_t, int64_t, uint64_t)
FMU_LOAD(i64_load32_u, uint32_t, uint64_t, uint64_t)
FMU_LOAD(f32_load, float, float, float)
FMU_LOAD(f64_load, double, double, double)
FMU_STORE(i32_store, uint32_t, uint32_t)
FMU_STORE(i32_store8, uint8_t, uint32_t)
FMU_STORE(i32_store16, uint16_t, uint32_t)
FMU_STORE(i64_store, uint64_t, uint64_t)
FMU_STORE(i64_store8, uint8_t, uint64_t)
FMU_STORE(i64_store16, uint16_t, uint64_t)
FMU_STORE(i64_store32, uint32_t, uint64_t)
FMU_STORE(f32_store, float, float)
FMU_STORE(f64_store, double, double)

/* Integers. */

#define DIV_U(x, y) (UNLIKELY((y) == 0) ? TRAP(DIV_BY_ZERO) : (x) / (y))
#define REM_U(x, y) (UNLIKELY((y) == 0) ? TRAP(DIV_BY_ZERO) : (x) % (y))
#define FMU_DIV_S(u, s, least, x, y)                                \
    (UNLIKELY((y) == 0)                          ? TRAP(DIV_BY_ZERO)  \
     : UNLIKELY((s)(x) == least && (s)(y) == -1) ? TRAP(INT_OVERFLOW) \
                                                 : (u)((s)(x) / (s)(y)))
#define FMU_REM_S(u, s, x, y) \
    (UNLIKELY((y) == 0) ? TRAP(DIV_BY_ZERO) : UNLIKELY((s)(y) == -1) ? 0 : (u)((s)(x) % (s)(y)))
#define I32_DIV_S(x, y) FMU_DIV_S(uint32_t, int32_t, INT32_MIN, x, y)
#define I64_DIV_S(x, y) FMU_DIV_S(uint64_t, int64_t, INT64_MIN, x, y)
#define I32_REM_S(x, y) FMU_REM_S(uint32_t, int32_t, x, y)
#define I64_REM_S(x, y) FMU_REM_S(uint64_t, int64_t, x, y)

#define I32_ROTL(x, y) (((x) << ((y) & 31)) | ((x) >> ((32 - ((y) & 31)) & 31)))
#define I32_ROTR(x, y) (((x) >> ((y) & 31)) | ((x) << ((32 - ((y) & 31)) & 31)))
#define I64_ROTL(x, y) (((x) << ((y) & 63)) | ((x) >> ((64 - ((y) & 63)) & 63)))
#define I64_ROTR(x, y) (((x) >> ((y) & 63)) | ((x) << ((64 - ((y) & 63)) & 63)))

#ifdef __GNUC__
#define I32_CLZ(x) ((x) ? (uint32_t)__builtin_clz(x) : 32u)
#define I64_CLZ(x) ((x) ? (uint64_t)__builtin_clzll(x) : 64u)
#define I32_CTZ(x) ((x) ? (uint32_t)__builtin_ctz(x) : 32u)
#define I64_CTZ(x) ((x) ? (uint64_t)__builtin_ctzll(x) : 64u)
#define I32_POPCNT(x) ((uint32_t)__builtin_popcount(x))
#define I64_POPCNT(x) ((uint64_t)__builtin_popcountll(x))
#else
static inline uint64_t I64_POPCNT(uint64_t x) {
    uint64_t count = 0;
    for (; x != 0; x &= x - 1) {
        count++;
    }
    return count;
}
static inline uint64_t I64_CLZ(uint64_t x) {
    uint64_t count = 64;
    for (; x != 0; x >>= 1) {
        count--;
    }
    return count;
}
#define I64_CTZ(x) I64_POPCNT(~(x) & ((x)-1))
#define I32_POPCNT(x) ((uint32_t)I64_POPCNT(x))
#define I32_CLZ(x) ((uint32_t)I64_CLZ(x) - 32)
#define I32_CTZ(x) ((x) ? (uint32_t)I64_CTZ((uint64_t)(x)) : 32u)
#endif

/* Floating-point numbers. */

#define FMU_REINTERPRET(name, from, to)       \
    static inline to name(from value) {       \
        to result;                            \
        memcpy(&result, &value, sizeof value); \
        return result;                        \
    }
FMU_REINTERPRET(i32_reinterpret_f32, float, uint32_t)
FMU_REINTERPRET(f32_reinterpret_i32, uint32_t, float)
FMU_REINTERPRET(i64_reinterpret_f64, double, uint64_t)
FMU_REINTERPRET(f64_reinterpret_i64, uint64_t, double)

#define wasm_fabs fabs
#define wasm_fabsf fabsf
#define wasm_ceil ceil
#define wasm_ceilf ceilf
#define wasm_floor floor
#define wasm_floorf floorf
#define wasm_trunc trunc
#define wasm_truncf truncf
#define wasm_nearbyint nearbyint
#define wasm_nearbyintf nearbyintf
#define wasm_sqrt sqrt
#define wasm_sqrtf sqrtf
#define wasm_quiet(x) (x)
#define wasm_quietf(x) (x)

/* Minimum and maximum of WebAssembly: NaN if an argument is NaN, and -0 is less than 0. */
#define FMIN(x, y) ((x) != (x) || (y) != (y) ? NAN : (x) == (y) ? (signbit(x) ? (x) : (y)) : (x) < (y) ? (x) : (y))
#define FMAX(x, y) ((x) != (x) || (y) != (y) ? NAN : (x) == (y) ? (signbit(x) ? (y) : (x)) : (x) > (y) ? (x) : (y))

/* Conversions to integers. The lower limit of a range is the number below the smallest integer, which is excluded. If the
   floating-point type cannot represent that number, the limit is the smallest integer itself. */
#define FMU_TRUNC(u, i, x, in_range) \
    ((x) != (x) ? (u)TRAP(INVALID_CONVERSION) : (in_range) ? (u)(i)(x) : (u)TRAP(INT_OVERFLOW))
#define FMU_TRUNC_SAT(u, i, x, in_range, least, most) \
    ((x) != (x) ? (u)0 : (in_range) ? (u)(i)(x) : (x) < 0 ? (u)(least) : (u)(most))

#define I32_S_F32(x) ((x) >= -2147483648.f && (x) < 2147483648.f)
#define I32_S_F64(x) ((x) > -2147483649. && (x) < 2147483648.)
#define I64_S(x) ((x) >= -9223372036854775808. && (x) < 9223372036854775808.)
#define I32_U(x) ((x) > -1 && (x) < 4294967296.)
#define I64_U(x) ((x) > -1 && (x) < 18446744073709551616.)
#define I32_TRUNC_S_F32(x) FMU_TRUNC(uint32_t, int32_t, x, I32_S_F32(x))
#define I32_TRUNC_S_F64(x) FMU_TRUNC(uint32_t, int32_t, x, I32_S_F64(x))
#define I32_TRUNC_U_F32(x) FMU_TRUNC(uint32_t, uint32_t, x, I32_U(x))
#define I32_TRUNC_U_F64(x) FMU_TRUNC(uint32_t, uint32_t, x, I32_U(x))
#define I64_TRUNC_S_F32(x) FMU_TRUNC(uint64_t, int64_t, x, I64_S(x))
#define I64_TRUNC_S_F64(x) FMU_TRUNC(uint64_t, int64_t, x, I64_S(x))
#define I64_TRUNC_U_F32(x) FMU_TRUNC(uint64_t, uint64_t, x, I64_U(x))
#define I64_TRUNC_U_F64(x) FMU_TRUNC(uint64_t, uint64_t, x, I64_U(x))
#define I32_TRUNC_SAT_S_F32(x) FMU_TRUNC_SAT(uint32_t, int32_t, x, I32_S_F32(x), INT32_MIN, INT32_MAX)
#define I32_TRUNC_SAT_S_F64(x) FMU_TRUNC_SAT(uint32_t, int32_t, x, I32_S_F64(x), INT32_MIN, INT32_MAX)
#define I32_TRUNC_SAT_U_F32(x) FMU_TRUNC_SAT(uint32_t, uint32_t, x, I32_U(x), 0, UINT32_MAX)
#define I32_TRUNC_SAT_U_F64(x) FMU_TRUNC_SAT(uint32_t, uint32_t, x, I32_U(x), 0, UINT32_MAX)
#define I64_TRUNC_SAT_S_F32(x) FMU_TRUNC_SAT(uint64_t, int64_t, x, I64_S(x), INT64_MIN, INT64_MAX)
#define I64_TRUNC_SAT_S_F64(x) FMU_TRUNC_SAT(uint64_t, int64_t, x, I64_S(x), INT64_MIN, INT64_MAX)
#define I64_TRUNC_SAT_U_F32(x) FMU_TRUNC_SAT(uint64_t, uint64_t, x, I64_U(x), 0, UINT64_MAX)
#define I64_TRUNC_SAT_U_F64(x) FMU_TRUNC_SAT(uint64_t, uint64_t, x, I64_U(x), 0, UINT64_MAX)

#endif
