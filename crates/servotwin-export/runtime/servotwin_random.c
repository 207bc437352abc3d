#include "servotwin_random.h"

#include "servotwin_math.h"

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

static uint64_t splitmix64(uint64_t *counter)
{
    *counter += 0x9E3779B97F4A7C15U;
    uint64_t mixed = *counter;
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9U;
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBU;
    return mixed ^ (mixed >> 31);
}

static uint64_t rotated(uint64_t bits, uint32_t by)
{
    const uint32_t back = 64U - by;
    return (bits << by) | (bits >> back);
}

static uint64_t next_bits(uint64_t *state)
{
    const uint64_t result = rotated(state[0] + state[3], 23U) + state[0];
    const uint64_t shifted = state[1] << 17;
    state[2] ^= state[0];
    state[3] ^= state[1];
    state[1] ^= state[2];
    state[0] ^= state[3];
    state[2] ^= shifted;
    state[3] = rotated(state[3], 45U);
    return result;
}

servotwin_real servotwin_normal(uint64_t seed, uint64_t stream)
{
    uint64_t of_stream = stream;
    uint64_t state[4];
    servotwin_real sum = 0.0;
    uint64_t counter = seed ^ splitmix64(&of_stream);
    for (int32_t i = 0; i < 4; i++) {
        state[i] = splitmix64(&counter);
    }
    for (int32_t i = 0; i < 12; i++) {
        const uint64_t kept = next_bits(state) >> SERVOTWIN_DROPPED_BITS;
        const servotwin_real unit = (servotwin_real)kept * SERVOTWIN_STEP;
        sum = sum + unit;
    }
    return sum - 6.0;
}

bool servotwin_random_keeps_rules(void)
{
    return servotwin_keeps_rules();
}
