// The 28.9 m Gunnerus in wind, explicit Euler, as one writes it by hand for AVX-512: see by_hand.py.
// -DREAL=double or float, and of these -DINTEGER, -DW (lanes), -DBITS, -DMANTISSA.
#include <immintrin.h>
typedef REAL V __attribute__((vector_size(64)));
typedef INTEGER M __attribute__((vector_size(64)));
typedef REAL U __attribute__((vector_size(64), aligned(sizeof(REAL)), may_alias));
#define K(x) ((V){} + (REAL)(x))
#define SIGN ((M){} + ((INTEGER)1 << (BITS - 1)))
#define ROUND K(1.5 * ((INTEGER)1 << MANTISSA))
#define HORNER(p, c, x) V p = K(c[sizeof c / sizeof *c - 1]); for (int k = sizeof c / sizeof *c - 2; k >= 0; --k) p = p * x + K(c[k]);
#if BITS == 64
#define MASK __mmask8
#define I(x) ((__m512i)(x))
#define LESS(x, y) _mm512_cmp_pd_mask(x, y, _CMP_LT_OQ)
#define ODD(m) _mm512_test_epi64_mask(I(m), _mm512_set1_epi64(1))
#define MIN(x, y) _mm512_min_pd(x, y)
#define MAX(x, y) _mm512_max_pd(x, y)
#define PICK(m, x, y) _mm512_mask_mov_pd(y, m, x)
#define SUB(m, x, y, z) _mm512_mask_sub_pd(x, m, y, z)
#define ADD(m, x, y, z) _mm512_mask_add_pd(x, m, y, z)
#define MIX(x, m, y) ((V)_mm512_ternarylogic_epi64(I(x), I(m), I(y), 0x78)) // x ^ (m & y)
#define BEYOND(at) _mm512_test_epi64_mask(I(at), _mm512_set1_epi64(16))
#define LOOKED(t, at, far) \
  ((V)_mm512_mask_permutexvar_pd(_mm512_permutex2var_pd(t[0], I(at), t[1]), far, I(at), t[2]))
#define ROWS 3
#else
#define MASK __mmask16
#define I(x) ((__m512i)(x))
#define LESS(x, y) _mm512_cmp_ps_mask(x, y, _CMP_LT_OQ)
#define ODD(m) _mm512_test_epi32_mask(I(m), _mm512_set1_epi32(1))
#define MIN(x, y) _mm512_min_ps(x, y)
#define MAX(x, y) _mm512_max_ps(x, y)
#define PICK(m, x, y) _mm512_mask_mov_ps(y, m, x)
#define SUB(m, x, y, z) _mm512_mask_sub_ps(x, m, y, z)
#define ADD(m, x, y, z) _mm512_mask_add_ps(x, m, y, z)
#define MIX(x, m, y) ((V)_mm512_ternarylogic_epi32(I(x), I(m), I(y), 0x78))
#define BEYOND(at) 0
#define LOOKED(t, at, far) ((V)_mm512_permutex2var_ps(t[0], I(at), t[1]))
#define ROWS 2
#endif
#define ABS(x) ((V)((M)(x) & ~SIGN))

static const double SINE[] = {SINE_COEFFICIENTS}, COSINE[] = {COSINE_COEFFICIENTS}, ARC[] = {ARC_COEFFICIENTS},
                    EXP[] = {EXP_COEFFICIENTS}, QUARTER[] = {QUARTERS}, HALF[] = {HALVES};

typedef struct { V ca, sa, ax, ay, an, bx, by, bn; } Unit; // of one group: what its commands give

// tanh(size * scale), 0 <= size * scale < 20
static inline V tanh_of(V size, V scale) {
  V turned = size * (scale * K(1 / HALF[0])) + ROUND, n = turned - ROUND;
  V r = (size * scale - n * K(HALF[0])) - n * K(HALF[1]);
  HORNER(p, EXP, r)
  V power = (V)((M)K(1) + ((M)turned << MANTISSA)), less = power * (p * r) + (power - K(1));
  return less / (less + K(2));
}

// p : parameters as vectors; forces X, Y, N of one unit are added
static inline void unit(const V *p, const Unit *of, V u, V v, V r, V *X, V *Y, V *N) {
  V along = u - r * p[1], across = v + r * p[0];
  V J = of->ca * along + of->sa * across, y = of->ca * across - of->sa * along;
  V J_c = MIN(MAX(J, p[2]), p[3]), y_c = MIN(MAX(y, -p[4]), p[4]), size = ABS(y_c);
  V t = tanh_of(size, p[5]), beyond = J - J_c, over = MAX(beyond, K(0)), under = beyond - over;
  V K_x = p[6] + J_c * ((p[7] + p[10] * t) + J_c * (p[8] + J_c * p[9])) + y_c * y_c * (p[11] + p[12] * J_c);
  K_x -= over * (p[13] + p[14] * over) + p[15] * under;
  V K_y = y_c * (p[16] + p[17] * J_c + p[18] * size) - (p[19] + p[20] * MAX(J_c, K(0))) * (y - y_c);
  *X += of->ax * K_x - of->bx * K_y;
  *Y += of->ay * K_x + of->by * K_y;
  *N += of->an * K_x + of->bn * K_y;
}

static inline void step(V x[6], const V *p, const V table[6][ROWS], const Unit units[2], V north, V east) {
  V psi = x[2], u = x[3], v = x[4], r = x[5];
  V turned = psi * K(1 / QUARTER[0]) + ROUND, n = turned - ROUND;
  V a = ((psi - n * K(QUARTER[0])) - n * K(QUARTER[1])) - n * K(QUARTER[2]), z = a * a;
  HORNER(sp, SINE, z)
  HORNER(cp, COSINE, z)
  V sine = a + a * z * sp, cosine = K(1) + z * cp;
  MASK odd = ODD(turned);
  V s = PICK(odd, cosine, sine), c = PICK(odd, sine, cosine);
  s = MIX(s, (M)turned << (BITS - 2), SIGN);
  c = MIX(c, ((M)turned + 1) << (BITS - 2), SIGN);

  V ur = u - north * c - east * s, vr = v - east * c + north * s, q = ur * ur + vr * vr;
  V ahead = ABS(ur), aside = ABS(vr), least = MIN(ahead, aside), most = MAX(MAX(ahead, aside), K(1e-37));
  MASK steep = LESS(most * K(0.41421356237309503), least);
  V t = SUB(steep, least, least, most) / ADD(steep, most, most, least), w = t * t;
  HORNER(ap, ARC, w)
  V angle = t + t * w * ap;
  angle = ADD(steep, angle, angle, K(0.7853981633974483));
  angle = SUB(LESS(ahead, aside), angle, K(1.5707963267948966), angle);
  angle = SUB(LESS(ur, K(0)), angle, K(3.141592653589793), angle);
  V at = angle * K(5.729577951308232), whole = (at - K(0.5)) + ROUND, part = at - (whole - ROUND);
  MASK far = BEYOND(whole);
  V C_X = LOOKED(table[0], whole, far) + part * LOOKED(table[1], whole, far);
  V C_Y = LOOKED(table[2], whole, far) + part * LOOKED(table[3], whole, far);
  V C_N = LOOKED(table[4], whole, far) + part * LOOKED(table[5], whole, far);
  V sided = MIX(q, vr, SIGN); // the table's sign is turned in Python

  V v2 = v * v, r2 = r * r, au = ABS(u), av = ABS(v), ar = ABS(r);
  V X = u * (p[0] * au + p[1] * av + v * (p[2] * r + p[3] * v) + p[4] * r2) + v * (p[5] * v + p[6] * r) + p[7] * r2;
  const V *y = p + 8, *m = p + 20;
#define SIDE(k) \
  v * (k[0] * v2 + k[1] * r2 + k[2] * av + k[3] * ar + u * (k[4] + u * k[5])) + \
  r * (k[6] * r2 + k[7] * v2 + k[8] * av + k[9] * ar + u * (k[10] + u * k[11]))
  V Y = SIDE(y), N = SIDE(m);
  X += q * C_X, Y += sided * C_Y, N += sided * C_N;
  unit(p + 37, units, u, v, r, &X, &Y, &N);
  unit(p + 58, units + 1, u, v, r, &X, &Y, &N);

  const V *solve = p + 32;
  x[0] += c * u - s * v, x[1] += s * u + c * v, x[2] += r;
  x[3] = u + solve[0] * X, x[4] = v + (solve[1] * Y + solve[2] * N), x[5] = r + (solve[3] * Y + solve[4] * N);
}

// numbers (members, 79), tables (members, 6, ROWS * W), start (6, stride), held (members, 18, stride): of each unit
// ca, sa, ax, ay, an, bx, by, bn, then north, east; out (6, members, stride)
void run(long members, long stride, long steps, const REAL *numbers, const REAL *tables, const REAL *start,
         const REAL *held, REAL *out) {
  for (long member = 0; member < members; ++member) {
    V p[79], table[6][ROWS];
    for (int i = 0; i < 79; ++i) p[i] = K(numbers[member * 79 + i]);
    for (int i = 0; i < 6 * ROWS; ++i) table[i / ROWS][i % ROWS] = *(const U *)(tables + (member * 6 * ROWS + i) * W);
    for (long g = 0; g < stride; g += GROUPS * W) {
      V x[GROUPS][6], wind[GROUPS][2];
      Unit units[GROUPS][2];
      for (int j = 0; j < GROUPS; ++j) {
        for (int i = 0; i < 6; ++i) x[j][i] = *(const U *)(start + i * stride + g + j * W);
        for (int i = 0; i < 16; ++i) ((V *)units[j])[i] = *(const U *)(held + (member * 18 + i) * stride + g + j * W);
        for (int i = 0; i < 2; ++i) wind[j][i] = *(const U *)(held + (member * 18 + 16 + i) * stride + g + j * W);
      }
      for (long k = 0; k < steps; ++k)
#pragma GCC unroll 8 // so that the compiler interleaves the groups
        for (int j = 0; j < GROUPS; ++j) step(x[j], p, table, units[j], wind[j][0], wind[j][1]);
      for (int j = 0; j < GROUPS; ++j)
        for (int i = 0; i < 6; ++i) *(U *)(out + (i * members + member) * stride + g + j * W) = x[j][i];
    }
  }
}
