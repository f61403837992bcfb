/* A recording's messages, from the bytes of an MCAP chunk to rows of numbers.

   Only what is certain is taken: a flat JSON object whose wanted keys hold numbers, as the recorder writes it. At
   anything else the scan stops, and who called it reads that one record by other means and goes on behind it. So every
   row is the one that a full JSON parser gives. */

#ifndef ARMLOAD_JOINT_MESSAGES_H
#define ARMLOAD_JOINT_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

/* Arrays that a message may hold beside the position, in the order of a row; bits of `message_layout.arrays`. */
enum { VELOCITY_ARRAY, CURRENT_ARRAY, TORQUE_ARRAY, OPTIONAL_ARRAYS };
enum { MOST_JOINTS_OF_A_MESSAGE = 1024 };

typedef struct {
    const uint8_t *channels; /* numbers of the topic's channels, two bytes each, low byte first */
    size_t channel_count;
    unsigned arrays; /* bit k: the rows hold the optional array k */
    size_t joints;
} message_layout;

typedef struct {
    size_t rows;    /* filled */
    size_t missing; /* messages passed over because their feedback did not arrive */
    size_t at;      /* of the first record that was not taken */
} scanned_messages;

/* Numbers of a row: time_s, phase_s (NaN for null), position_rad, and the optional arrays. */
size_t message_row_width(const message_layout *layout);

/* Scan records from `at` until all of `room` rows are filled, or a record follows that is for somebody else: a
   channel, a message of the topic that is not as expected, or one that is not whole. Records of other kinds and of
   other channels are passed over. */
scanned_messages scan_messages(const uint8_t *records, size_t length, size_t at, const message_layout *layout,
                               double *table, size_t room);

#endif
