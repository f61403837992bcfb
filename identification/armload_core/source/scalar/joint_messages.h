/* Scanner of a recording's messages: from the bytes of an MCAP chunk to rows of numbers.

   It takes only flat JSON objects whose requested keys hold numbers, as the recorder writes them. At anything else the
   scan stops; the caller reads that record with a full JSON parser and continues after it. Every row is therefore the
   one that a full parser gives. */

#ifndef ARMLOAD_JOINT_MESSAGES_H
#define ARMLOAD_JOINT_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

/* Optional arrays of a message, in the order of a row; bits of `message_layout.arrays`. */
enum { VELOCITY_ARRAY, CURRENT_ARRAY, TORQUE_ARRAY, OPTIONAL_ARRAYS };
enum { MOST_JOINTS_OF_A_MESSAGE = 1024 };

typedef struct {
    const uint8_t *channels; /* numbers of the topic's channels, two bytes each, low byte first */
    size_t channel_count;
    unsigned arrays; /* bit k: the rows hold the optional array k */
    size_t joints;
} message_layout;

typedef struct {
    size_t rows;    /* rows filled */
    size_t missing; /* messages skipped because their feedback is missing */
    size_t at;      /* offset of the first record not taken */
} scanned_messages;

/* Numbers of a row: time_s, phase_s (NaN for null), position_rad, and the optional arrays. */
size_t message_row_width(const message_layout *layout);

/* Scan records from `at` until all `room` rows are filled, or a record follows that is left to the caller: a channel, a
   message of the topic that is not as expected, or a truncated record. Records of other kinds and channels are
   skipped. */
scanned_messages scan_messages(const uint8_t *records, size_t length, size_t at, const message_layout *layout,
                               double *table, size_t room);

#endif
