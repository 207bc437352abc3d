/*
 * Doubt about a boundary sensor: a wrong supply or return pressure looks like a leak or a closed valve. A shutdown waits
 * while a wrong reading explains all that the actuator shows, unless the residual follows the pressure drop of the line
 * otherwise than in health, which only a fault does. Nor does it wait if a return pressure fell beside a reading that
 * stayed where it was right.
 */
#ifndef SERVOTWIN_BOUNDARY_H
#define SERVOTWIN_BOUNDARY_H

#include "servotwin_exact.h"
#include "servotwin_windows.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sums over windows of a residual r and the twin's signal y. */
typedef struct {
    servotwin_real samples;
    servotwin_real windows; /* number of windows that share no sample */
    servotwin_real moments[3]; /* sums of r r, r y and y y */
} servotwin_sums;

typedef struct {
    uint32_t deviating; /* consecutive windows in which the sensor next to the boundary deviated */
    uint32_t explained; /* windows for which a wrong reading counts as an explanation */
    servotwin_sums since; /* windows of the deviation */
    servotwin_sums healthy; /* windows before it, none of which holds its onset */
    servotwin_sums waiting; /* healthy windows that may hold an onset */
    servotwin_sums filling;
    uint32_t filled;
    bool has_right; /* the sensor agreed with the twin beside a reading */
    servotwin_real right; /* that reading, SI */
    bool has_candidate;
    servotwin_real candidate; /* the reading beside the newest healthy window, which may hold an onset */
    servotwin_real moved; /* largest change of the reading since the deviation began, SI */
    servotwin_real shared; /* evidence that other sensors share its fall, nats */
    servotwin_real fallen; /* how far beyond what the reading explains, in parts of scale */
    bool has_fallen; /* by more than the reading moved */
    servotwin_real value; /* the true value if the reading is wrong, SI */
    bool has_recent;
    servotwin_real recent; /* mean of the reading over about the last window, SI */
} servotwin_doubt;

void servotwin_doubt_clear(servotwin_doubt *doubt);

/* Takes a new window of a length, beside a reading. `has_agreed` says whether the sensor ever agreed with the twin. */
void servotwin_doubt_take(
    servotwin_doubt *doubt, int32_t boundary, int32_t length, const servotwin_window *window,
    servotwin_real reading, bool has_agreed);

/* Whether the sensor has agreed with the twin for some windows. */
bool servotwin_has_agreed(const servotwin_doubt *doubt);

/* Evidence that the deviation is a fault and no wrong reading, nats. */
servotwin_real servotwin_boundary_evidence(const servotwin_doubt *doubt, int32_t boundary);

/* Whether a wrong reading explains the present windows, and is still possible. */
bool servotwin_is_doubtful(const servotwin_doubt *doubt, int32_t boundary);

#ifdef __cplusplus
}
#endif

#endif
