/* The features that trees read of a window. */
#ifndef SERVOTWIN_FEATURES_H
#define SERVOTWIN_FEATURES_H

#include "servotwin_exact.h"
#include "servotwin_windows.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes SERVOTWIN_FEATURES numbers. `stands_in` is 1.0 for each sensor with a stand-in value, else 0.0. */
void servotwin_features(const servotwin_window *window, const servotwin_real *stands_in, servotwin_real *row);

#ifdef __cplusplus
}
#endif

#endif
