/* Cycles of an on-board program's parts on the ATmega2560: the figures of twin/src/pairing/. See docs/pairing.md. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#define NOINLINE __attribute__((noinline, noclone))

static int put(char c, FILE *f) {
    while (!(UCSR0A & (1 << UDRE0)));
    UDR0 = c;
    return 0;
}
static FILE out = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);

static volatile uint16_t overflows;
ISR(TIMER1_OVF_vect) { overflows++; }
static uint32_t now(void) {
    cli();
    uint16_t low = TCNT1, high = overflows;
    if ((TIFR1 & 1) && low < 0x8000) high++;
    sei();
    return ((uint32_t)high << 16) | low;
}
/* An empty call costs about 12 cycles, which are part of every figure. */
#define MEASURE(name, expression) do { \
    uint32_t a = now(); expression; uint32_t b = now(); uint32_t c = now(); \
    printf(name " %lu\n", (b - a) - (c - b)); } while (0)

static NOINLINE void empty(void) { __asm__ volatile(""); }
static NOINLINE float add(float a, float b) { return a + b; }
static NOINLINE float multiply(float a, float b) { return a * b; }
static NOINLINE uint8_t compare(float a, float b) { return a > b; }

/* robot/src/speed_loop.rs */
typedef struct { float kp, ki_sample, integral; } pi_t;
static float clamp(float x, float limit) { return x > limit ? limit : (x < -limit ? -limit : x); }
static NOINLINE float pi_loop(pi_t *p, float command, float measured, float limit) {
    float e = command - measured;
    if (!(e - e == 0)) return 0;
    p->integral = clamp(p->integral + p->ki_sample * e, limit);
    return clamp(p->kp * e + p->integral, limit);
}
static NOINLINE float wheel_speed(int32_t *last, int32_t count, float scale) {
    int16_t difference = (int16_t)(count - *last);
    *last = count;
    return scale * (float)difference;
}
static NOINLINE float current(uint16_t sample, float offset, float scale) { return ((float)sample - offset) * scale; }
static NOINLINE int16_t duty(float volts, float per_volt) { return (int16_t)(volts * per_volt); }

/* robot/src/key.rs */
#define ROTATE(x, b) (((x) << (b)) | ((x) >> (64 - (b))))
#define ROUND do { \
    v0 += v1; v1 = ROTATE(v1, 13); v1 ^= v0; v0 = ROTATE(v0, 32); v2 += v3; v3 = ROTATE(v3, 16); v3 ^= v2; \
    v0 += v3; v3 = ROTATE(v3, 21); v3 ^= v0; v2 += v1; v1 = ROTATE(v1, 17); v1 ^= v2; v2 = ROTATE(v2, 32); } while (0)
static NOINLINE uint64_t siphash(const uint8_t *in, uint8_t n, const uint8_t *key) {
    uint64_t k0, k1;
    memcpy(&k0, key, 8);
    memcpy(&k1, key + 8, 8);
    uint64_t v0 = 0x736f6d6570736575ULL ^ k0, v1 = 0x646f72616e646f6dULL ^ k1;
    uint64_t v2 = 0x6c7967656e657261ULL ^ k0, v3 = 0x7465646279746573ULL ^ k1;
    uint8_t left = n & 7;
    const uint8_t *end = in + (n - left);
    for (; in != end; in += 8) {
        uint64_t m;
        memcpy(&m, in, 8);
        v3 ^= m;
        for (uint8_t i = 0; i < 2; i++) ROUND;
        v0 ^= m;
    }
    uint64_t b = 0;
    memcpy(&b, in, left);
    ((uint8_t *)&b)[7] = n;
    v3 ^= b;
    for (uint8_t i = 0; i < 2; i++) ROUND;
    v0 ^= b;
    v2 ^= 0xff;
    for (uint8_t i = 0; i < 4; i++) ROUND;
    return v0 ^ v1 ^ v2 ^ v3;
}
/* robot/src/crc.rs, robot/src/hex.rs, robot/src/frame/mod.rs */
static NOINLINE uint16_t crc(const uint8_t *p, uint8_t n) {
    uint16_t c = 0xffff;
    while (n--) {
        c ^= (uint16_t)*p++ << 8;
        for (uint8_t i = 0; i < 8; i++) c = (c & 0x8000) ? (c << 1) ^ 0x1021 : c << 1;
    }
    return c;
}
static uint8_t digit(uint8_t c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : 255; }
static NOINLINE uint8_t from_hex(const char *text, uint8_t *bytes, uint8_t n) {
    while (n--) {
        uint8_t high = digit(*text++), low = digit(*text++);
        if ((high | low) & 0xf0) return 0;
        *bytes++ = high << 4 | low;
    }
    return 1;
}
static NOINLINE void to_hex(const uint8_t *bytes, char *text, uint8_t n) {
    while (n--) {
        uint8_t high = *bytes >> 4, low = *bytes++ & 15;
        *text++ = high < 10 ? high + '0' : high + 55;
        *text++ = low < 10 ? low + '0' : low + 55;
    }
}
static NOINLINE int16_t to_field(float value, float scale) {
    float x = value * scale;
    if (x > 32767) x = 32767;
    if (x < -32768) x = -32768;
    return (int16_t)(x < 0 ? x - 0.5f : x + 0.5f);
}

static volatile int32_t count;
static const int8_t STEP[16] = {0, -1, 1, 0, 1, 0, 0, -1, -1, 0, 0, 1, 0, 1, -1, 0};
static uint8_t edges;
ISR(INT4_vect) {
    edges = ((edges << 2) | ((PINE >> 4) & 3)) & 15;
    count += STEP[edges];
}
static volatile uint8_t ring[128], head;
ISR(INT5_vect) {
    uint8_t h = head;
    ring[h & 127] = PINE;
    head = h + 1;
}
/* The same pin change with the interrupt on, less the one with it off. */
static void measure_interrupt(const char *name, uint8_t line) {
    uint32_t took[2];
    for (uint8_t off = 0; off < 2; off++) {
        EIFR = 0xff;
        EIMSK = off ? 0 : 1 << line;
        uint32_t a = now();
        PORTE ^= 1 << line;
        __asm__ volatile("nop\nnop\nnop\nnop");
        took[off] = now() - a;
    }
    EIMSK = 0;
    printf("%s %lu\n", name, took[0] - took[1]);
}

static volatile float x = 12.34f, y = -1.7f, z;
static volatile uint64_t hash;
static volatile uint16_t word;
static uint8_t bytes[80], decoded[80], key[16];
static char text[170];

int main(void) {
    UCSR0B = 1 << TXEN0;
    UBRR0 = 8;
    stdout = &out;
    TCCR1B = 1;
    TIMSK1 = 1;
    sei();
    pi_t loop = {0.8f, 6.0f / 480, 0.3f};
    int32_t last = 100;
    for (uint8_t i = 0; i < 80; i++) bytes[i] = i * 7;
    MEASURE("empty", empty());
    MEASURE("add", z = add(x, y));
    MEASURE("multiply", z = multiply(x, y));
    MEASURE("compare", word = compare(x, y));
    MEASURE("pi_loop", z = pi_loop(&loop, 11.1f + x, 3.3f, 24.0f));
    MEASURE("wheel_speed", z = wheel_speed(&last, 121, 2.45f));
    MEASURE("current", z = current(531, 512.3f, 0.0488f));
    MEASURE("duty", word = duty(7.7f, 41.6f));
    MEASURE("siphash_36", hash = siphash(bytes, 36, key));
    MEASURE("siphash_72", hash = siphash(bytes, 72, key));
    MEASURE("crc_34", word = crc(bytes, 34));
    MEASURE("crc_70", word = crc(bytes, 70));
    MEASURE("to_hex_77", to_hex(bytes, text, 77));
    MEASURE("from_hex_41", word = from_hex(text, decoded, 41));
    MEASURE("to_field", word = to_field(x, 100.0f));
    DDRE = 0xff;
    EICRB = (1 << ISC40) | (1 << ISC50);
    measure_interrupt("encoder_interrupt", 4);
    measure_interrupt("byte_interrupt", 5);
    cli();
    sleep_enable();
    sleep_cpu();
}
