#include "joint_messages.h"

#include <math.h>
#include <string.h>

enum {
    CHANNEL_RECORD = 4,
    MESSAGE_RECORD = 5,
    RECORD_HEADER = 9,   /* kind and length */
    MESSAGE_HEADER = 22, /* channel, sequence number and two times */
    MOST_DIGITS = 19,    /* decimal digits that fit into 64 bits */
    EXACT_TEN = 22,      /* 10^22 is the largest power of ten that is a double without rounding */
    EXACT_FIVE = 27,     /* 5^27 is the largest power of five that fits into 64 bits */
    LONGEST = 1000       /* decimals, and exponent: more are left to the full parser, far from overflow of an int */
};

/* Requested keys of a message; one bit each. */
enum {
    TIME_KEY,
    PHASE_KEY,
    MISSING_KEY,
    POSITION_KEY,
    FIRST_OPTIONAL_KEY,
    KEYS = FIRST_OPTIONAL_KEY + OPTIONAL_ARRAYS
};

static const char *const KEY_NAMES[KEYS] = {
    [TIME_KEY] = "time_s",
    [PHASE_KEY] = "phase_s",
    [MISSING_KEY] = "missing",
    [POSITION_KEY] = "position_rad",
    [FIRST_OPTIONAL_KEY + VELOCITY_ARRAY] = "velocity_rad_s",
    [FIRST_OPTIONAL_KEY + CURRENT_ARRAY] = "current_a",
    [FIRST_OPTIONAL_KEY + TORQUE_ARRAY] = "torque_nm",
};

typedef struct {
    const uint8_t *at, *end;
} text;

static void skip_blanks(text *json)
{
    while (json->at < json->end && (*json->at == ' ' || *json->at == '\n' || *json->at == '\r' || *json->at == '\t')) {
        json->at++;
    }
}

/* Take one character and the blanks around it. */
static int take(text *json, char wanted)
{
    skip_blanks(json);
    if (json->at == json->end || *json->at != (uint8_t)wanted) {
        return 0;
    }
    json->at++;
    skip_blanks(json);
    return 1;
}

static int take_word(text *json, const char *word)
{
    const size_t length = strlen(word);
    if ((size_t)(json->end - json->at) < length || memcmp(json->at, word, length) != 0) {
        return 0;
    }
    json->at += length;
    return 1;
}

/* Take a string of plain ASCII without escapes; any other string is left to the full parser. */
static int take_string(text *json, text *content)
{
    if (json->at == json->end || *json->at != '"') {
        return 0;
    }
    content->at = ++json->at;
    while (json->at < json->end && *json->at != '"') {
        if (*json->at < 0x20 || *json->at >= 0x80 || *json->at == '\\') {
            return 0;
        }
        json->at++;
    }
    if (json->at == json->end) {
        return 0;
    }
    content->end = json->at++;
    return 1;
}

static int is_digit(const text *json)
{
    return json->at < json->end && *json->at >= '0' && *json->at <= '9';
}

typedef struct {
    uint64_t digits; /* all digits, without the decimal point */
    int count;       /* number of digits without leading zeros; more than MOST_DIGITS do not fit */
    int exponent;    /* power of ten */
    int negative, whole;
} decimal;

static void take_digits(text *json, decimal *number)
{
    for (; is_digit(json); json->at++) {
        number->digits = 10 * number->digits + (uint64_t)(*json->at - '0');
        number->count += number->count > 0 || *json->at != '0';
    }
}

/* Take a JSON number. */
static int take_decimal(text *json, decimal *number)
{
    *number = (decimal){.whole = 1};
    if (json->at < json->end && *json->at == '-') {
        number->negative = 1;
        json->at++;
    }
    const uint8_t *first = json->at;
    take_digits(json, number);
    if (json->at == first || (*first == '0' && json->at - first > 1)) {
        return 0;
    }
    if (json->at < json->end && *json->at == '.') {
        const uint8_t *point = json->at++;
        take_digits(json, number);
        if (json->at - point == 1 || json->at - point > LONGEST) {
            return 0;
        }
        number->exponent = 1 - (int)(json->at - point);
        number->whole = 0;
    }
    if (json->at < json->end && (*json->at == 'e' || *json->at == 'E')) {
        int exponent = 0, negative = 0;
        json->at++;
        if (json->at < json->end && (*json->at == '-' || *json->at == '+')) {
            negative = *json->at++ == '-';
        }
        if (!is_digit(json)) {
            return 0;
        }
        for (; is_digit(json) && exponent < LONGEST; json->at++) {
            exponent = 10 * exponent + (*json->at - '0');
        }
        number->exponent += negative ? -exponent : exponent;
        number->whole = 0;
    }
    return !is_digit(json);
}

/* digits / 10^k as a double, k <= EXACT_FIVE, rounded once: the quotient has at least 63 bits, and its last bit is set
   if the remainder is not zero. */
static double quotient(uint64_t digits, int k)
{
    uint64_t divisor = 1;
    int scale = -63 - k;
    for (int power = 0; power < k; power++) {
        divisor *= 5;
    }
    for (; divisor < UINT64_C(1) << 63; scale++) {
        divisor <<= 1;
    }
    for (; digits < UINT64_C(1) << 63; scale--) {
        digits <<= 1;
    }
    __extension__ const unsigned __int128 dividend = (unsigned __int128)digits << 63;
    const uint64_t result = (uint64_t)(dividend / divisor);
    const int left_over = (unsigned __int128)result * divisor != dividend;
    return ldexp((double)(result | (uint64_t)left_over), scale);
}

/* The nearest double. Returns 0 if the number is left to the full parser. */
static int to_double(const decimal *number, double *value)
{
    static const double POWERS[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                    1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    const int exponent = number->exponent;
    double size;
    if (number->count > MOST_DIGITS || (number->whole && number->negative && number->digits == 0)) {
        return 0;
    }
    if (number->digits == 0) {
        size = 0.0;
    } else if (number->digits <= UINT64_C(1) << 53 && exponent >= -EXACT_TEN && exponent <= EXACT_TEN) {
        /* both operands are exact doubles, so that the result is rounded once */
        size = (double)number->digits;
        size = exponent < 0 ? size / POWERS[-exponent] : size * POWERS[exponent];
    } else if (exponent <= 0 && exponent >= -EXACT_FIVE) {
        size = quotient(number->digits, -exponent);
    } else {
        return 0;
    }
    *value = number->negative ? -size : size;
    return 1;
}

static int take_number(text *json, double *value)
{
    decimal number;
    return take_decimal(json, &number) && to_double(&number, value);
}

static int take_numbers(text *json, double *values, size_t count)
{
    if (!take(json, '[')) {
        return 0;
    }
    for (size_t k = 0; k < count; k++) {
        if ((k && !take(json, ',')) || !take_number(json, values + k)) {
            return 0;
        }
    }
    return take(json, ']');
}

static int take_flags(text *json, size_t count, int *any)
{
    if (!take(json, '[')) {
        return 0;
    }
    for (size_t k = 0; k < count; k++) {
        if (k && !take(json, ',')) {
            return 0;
        }
        if (take_word(json, "true")) {
            *any = 1;
        } else if (!take_word(json, "false")) {
            return 0;
        }
    }
    return take(json, ']');
}

static int skip_scalar(text *json)
{
    text content;
    decimal number;
    return take_string(json, &content) || take_word(json, "true") || take_word(json, "false") || take_word(json, "null")
           || take_decimal(json, &number);
}

/* Skip values that were not requested: a scalar, or a list of scalars. */
static int skip_value(text *json)
{
    if (json->at == json->end || *json->at != '[') {
        return skip_scalar(json);
    }
    take(json, '[');
    if (take(json, ']')) {
        return 1;
    }
    do {
        if (!skip_scalar(json)) {
            return 0;
        }
    } while (take(json, ','));
    return take(json, ']');
}

/* The requested key that a string names, or KEYS. */
static int key_of(const text *name)
{
    const size_t length = (size_t)(name->end - name->at);
    for (int key = 0; key < KEYS; key++) {
        if (strlen(KEY_NAMES[key]) == length && memcmp(KEY_NAMES[key], name->at, length) == 0) {
            return key;
        }
    }
    return KEYS;
}

typedef struct {
    unsigned wanted;     /* bit k: key k is requested */
    size_t column[KEYS]; /* first column of each key's numbers */
    size_t joints;
} row_plan;

static row_plan plan_of(const message_layout *layout)
{
    row_plan plan = {.wanted = (1u << FIRST_OPTIONAL_KEY) - 1, .joints = layout->joints};
    plan.column[PHASE_KEY] = 1;
    plan.column[POSITION_KEY] = 2;
    size_t column = 2 + layout->joints;
    for (int array = 0; array < OPTIONAL_ARRAYS; array++) {
        if (layout->arrays & (1u << array)) {
            plan.wanted |= 1u << (FIRST_OPTIONAL_KEY + array);
            plan.column[FIRST_OPTIONAL_KEY + array] = column;
            column += layout->joints;
        }
    }
    return plan;
}

static int take_wanted(text *json, int key, const row_plan *plan, double *row, int *missing)
{
    double *place = row + plan->column[key];
    switch (key) {
    case TIME_KEY:
        return take_number(json, place);
    case PHASE_KEY:
        *place = NAN;
        return take_word(json, "null") || take_number(json, place);
    case MISSING_KEY:
        return take_flags(json, plan->joints, missing);
    default:
        return take_numbers(json, place, plan->joints);
    }
}

/* One message into a row. Returns 0 if it is not exactly as expected. */
static int take_message(text json, const row_plan *plan, double *row, int *missing)
{
    unsigned found = 0;
    *missing = 0;
    if (!take(&json, '{')) {
        return 0;
    }
    do {
        text name;
        if (!take_string(&json, &name) || !take(&json, ':')) {
            return 0;
        }
        const int key = key_of(&name);
        const unsigned bit = 1u << key;
        if (!(plan->wanted & bit)) {
            if (!skip_value(&json)) {
                return 0;
            }
        } else if ((found & bit) || !take_wanted(&json, key, plan, row, missing)) {
            return 0;
        }
        found |= plan->wanted & bit;
    } while (take(&json, ','));
    return take(&json, '}') && json.at == json.end && found == plan->wanted;
}

static int on_topic(const uint8_t *content, const message_layout *layout)
{
    for (size_t k = 0; k < layout->channel_count; k++) {
        if (memcmp(content, layout->channels + 2 * k, 2) == 0) {
            return 1;
        }
    }
    return 0;
}

size_t message_row_width(const message_layout *layout)
{
    size_t arrays = 1;
    for (unsigned bits = layout->arrays; bits; bits >>= 1) {
        arrays += bits & 1u;
    }
    return 2 + arrays * layout->joints;
}

scanned_messages scan_messages(const uint8_t *records, size_t length, size_t at, const message_layout *layout,
                               double *table, size_t room)
{
    const size_t width = message_row_width(layout);
    const row_plan plan = plan_of(layout);
    scanned_messages scanned = {0, 0, at};
    while (scanned.at < length && length - scanned.at >= RECORD_HEADER && scanned.rows < room) {
        const uint8_t *header = records + scanned.at, *content = header + RECORD_HEADER;
        uint64_t size = 0;
        for (int byte = 8; byte > 0; byte--) {
            size = size << 8 | header[byte];
        }
        if (size > length - scanned.at - RECORD_HEADER || header[0] == CHANNEL_RECORD) {
            break;
        }
        if (header[0] == MESSAGE_RECORD) {
            int missing;
            if (size < MESSAGE_HEADER) {
                break;
            }
            if (on_topic(content, layout)) {
                const text json = {content + MESSAGE_HEADER, content + size};
                if (!take_message(json, &plan, table + scanned.rows * width, &missing)) {
                    break;
                }
                scanned.rows += !missing;
                scanned.missing += (size_t)(missing != 0);
            }
        }
        scanned.at += RECORD_HEADER + (size_t)size;
    }
    return scanned;
}
