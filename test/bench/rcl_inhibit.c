// Plays the bridge towards an inhibitor: publishes joint states, takes overrides, raw.
//
// usage: rcl_inhibit MODE COUNT WARM_UP PERIOD_US < JOINTS   -> JSON on stdout, times in us
//
// MODE      closed: the next state leaves when the answer came, and not before its time, as in
//                   rcl_echo; open: states leave at their times, whatever comes back
// WARM_UP   answers that are not counted; counting begins when the inhibitor is armed, and the
//           first answer shows that
// JOINTS    one line for each joint: NAME START GOAL [rad]
//
// The arm moves to and fro between a tenth and half of the way, so that decisions change and
// nothing ends the swing.
#define _GNU_SOURCE
#include <math.h>
#include <rcl/error_handling.h>
#include <rcl/rcl.h>
#include <rosidl_runtime_c/message_type_support_struct.h>
#include <rosidl_runtime_c/primitives_sequence_functions.h>
#include <rosidl_runtime_c/string_functions.h>
#include <sensor_msgs/msg/joint_state.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <fastswing_msgs/msg/current_override.h>

#define CHECK(call)                                                                         \
  do {                                                                                      \
    rcl_ret_t ret_ = (call);                                                                \
    if (ret_ != RCL_RET_OK) {                                                               \
      fprintf(stderr, "%s:%d: %d %s\n", __FILE__, __LINE__, ret_, rcl_get_error_string().str); \
      exit(1);                                                                              \
    }                                                                                       \
  } while (0)

enum { MOST_JOINTS = 100, STAMP_AT = 4, ARM_WITHIN_SEC = 60, LOST_AFTER_NS = 100000000, GIVE_UP_AFTER = 20 };

typedef struct {
  double start[MOST_JOINTS], goal[MOST_JOINTS];
  size_t count;
  sensor_msgs__msg__JointState message;
} Arm;

typedef struct {
  rcl_wait_set_t wait_set;
  rcl_publisher_t publisher;
  rcl_subscription_t subscription;
  rcl_serialized_message_t raw;
} Link;

typedef struct {
  int64_t *latency;
  int64_t newest;
  int sent, answered, out_of_order;
} Tally;

static int64_t now_ns(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void sleep_until(int64_t when) {
  struct timespec t = {when / 1000000000LL, when % 1000000000LL};
  clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
}

static int rising(const void *a, const void *b) {
  int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
  return (x > y) - (x < y);
}

static void read_arm(Arm *arm) {
  char names[MOST_JOINTS][64];
  while (arm->count < MOST_JOINTS && scanf("%63s %lf %lf", names[arm->count],
                                           &arm->start[arm->count], &arm->goal[arm->count]) == 3)
    arm->count++;
  sensor_msgs__msg__JointState__init(&arm->message);
  rosidl_runtime_c__String__Sequence__init(&arm->message.name, arm->count);
  rosidl_runtime_c__double__Sequence__init(&arm->message.position, arm->count);
  rosidl_runtime_c__double__Sequence__init(&arm->message.velocity, arm->count);
  for (size_t i = 0; i < arm->count; i++)
    rosidl_runtime_c__String__assign(&arm->message.name.data[i], names[i]);
}

// Publishes the state of this moment; returns its stamp [ns].
static int64_t publish_state(Arm *arm, Link *link) {
  int64_t stamp = now_ns(CLOCK_REALTIME);
  double share = 0.3 + 0.2 * sin(fmod(stamp * 1e-9, 1.0) * 2.0 * M_PI);
  for (size_t i = 0; i < arm->count; i++) {
    double way = arm->goal[i] - arm->start[i];
    arm->message.position.data[i] = arm->start[i] + share * way;
    arm->message.velocity.data[i] = way;
  }
  arm->message.header.stamp.sec = (int32_t)(stamp / 1000000000LL);
  arm->message.header.stamp.nanosec = (uint32_t)(stamp % 1000000000LL);
  CHECK(rcl_publish(&link->publisher, &arm->message, NULL));
  return stamp;
}

// Takes an override, waiting until `deadline` at most; returns its stamp [ns], 0 if none came.
static int64_t take_override(Link *link, int64_t deadline) {
  for (;;) {
    int64_t left = deadline - now_ns(CLOCK_MONOTONIC);
    if (left <= 0) return 0;
    CHECK(rcl_wait_set_clear(&link->wait_set));
    CHECK(rcl_wait_set_add_subscription(&link->wait_set, &link->subscription, NULL));
    rcl_ret_t ret = rcl_wait(&link->wait_set, left);
    if (ret == RCL_RET_TIMEOUT) return 0;
    CHECK(ret);
    rmw_message_info_t info;
    if (rcl_take_serialized_message(&link->subscription, &link->raw, &info, NULL) != RCL_RET_OK) {
      rcl_reset_error();
      continue;
    }
    int32_t sec;
    uint32_t nanosec;
    memcpy(&sec, link->raw.buffer + STAMP_AT, 4);
    memcpy(&nanosec, link->raw.buffer + STAMP_AT + 4, 4);
    return sec * 1000000000LL + nanosec;
  }
}

static void count_answer(Tally *tally, int64_t stamp, int64_t latency) {
  tally->out_of_order += stamp <= tally->newest;
  tally->newest = stamp;
  tally->latency[tally->answered++] = latency;
}

// Publishes at 500 Hz until the inhibitor answers: somebody has to arm it meanwhile.
static int until_armed(Arm *arm, Link *link) {
  int64_t end = now_ns(CLOCK_MONOTONIC) + ARM_WITHIN_SEC * 1000000000LL;
  while (now_ns(CLOCK_MONOTONIC) < end) {
    publish_state(arm, link);
    if (take_override(link, now_ns(CLOCK_MONOTONIC) + 2000000)) return 1;
  }
  fprintf(stderr, "the inhibitor was not armed within %d s\n", ARM_WITHIN_SEC);
  return 0;
}

static void run_closed(Arm *arm, Link *link, Tally *tally, int count, int warm, int64_t period) {
  int silent = 0;  // a disarmed inhibitor does not come back by itself
  for (int i = 0; i < count + warm && silent < GIVE_UP_AFTER; i++) {
    int64_t begin = now_ns(CLOCK_MONOTONIC);
    int64_t stamp = publish_state(arm, link), answer;
    do {
      answer = take_override(link, begin + LOST_AFTER_NS);
    } while (answer && answer != stamp);
    int64_t end = now_ns(CLOCK_MONOTONIC);
    silent = answer ? 0 : silent + 1;
    if (i >= warm) {
      tally->sent++;
      if (answer) count_answer(tally, stamp, end - begin);
    }
    if (begin + period > end) sleep_until(begin + period);
  }
}

static void run_open(Arm *arm, Link *link, Tally *tally, int count, int warm, int64_t period) {
  int64_t first = 0, begin = now_ns(CLOCK_MONOTONIC);
  for (int i = 0; i <= count + warm; i++) {
    // The last turn only waits for answers that are on their way.
    int64_t due = begin + (i + 1) * period + (i == count + warm ? LOST_AFTER_NS : 0);
    if (i < count + warm) {
      int64_t stamp = publish_state(arm, link);
      if (i == warm) first = stamp;
      tally->sent += i >= warm;
    }
    int64_t answer;
    while ((answer = take_override(link, due)))
      if (first && answer >= first && tally->answered < count)
        count_answer(tally, answer, now_ns(CLOCK_REALTIME) - answer);
  }
}

static void print_tally(Tally *tally) {
  int n = tally->answered;
  int64_t *sorted = tally->latency;
  qsort(sorted, n, sizeof *sorted, rising);
  printf("{\"sent\": %d, \"n\": %d, \"lost\": %d, \"out_of_order\": %d", tally->sent, n,
         tally->sent - n, tally->out_of_order);
  if (n)
    printf(", \"p50\": %.1f, \"p90\": %.1f, \"p99\": %.1f, \"p999\": %.1f, \"max\": %.1f",
           sorted[n / 2] / 1e3, sorted[(int)(n * 0.9)] / 1e3, sorted[(int)(n * 0.99)] / 1e3,
           sorted[(int)(n * 0.999)] / 1e3, sorted[n - 1] / 1e3);
  printf("}\n");
}

static void open_link(Link *link, rcl_context_t *context, rcl_node_t *node) {
  rcl_allocator_t allocator = rcl_get_default_allocator();
  rcl_init_options_t options = rcl_get_zero_initialized_init_options();
  CHECK(rcl_init_options_init(&options, allocator));
  CHECK(rcl_init(0, NULL, &options, context));
  rcl_node_options_t node_options = rcl_node_get_default_options();
  node_options.enable_rosout = false;
  CHECK(rcl_node_init(node, "bench_bridge", "", context, &node_options));
  rcl_publisher_options_t states = rcl_publisher_get_default_options();
  states.qos.depth = 1;
  states.qos.reliability = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  CHECK(rcl_publisher_init(&link->publisher, node,
                           ROSIDL_GET_MSG_TYPE_SUPPORT(sensor_msgs, msg, JointState),
                           "joint_states", &states));
  // Best effort as the bridge's own, but so deep that no answer is overwritten before it counts.
  rcl_subscription_options_t overrides = rcl_subscription_get_default_options();
  overrides.qos.depth = 100;
  overrides.qos.reliability = RMW_QOS_POLICY_RELIABILITY_BEST_EFFORT;
  CHECK(rcl_subscription_init(&link->subscription, node,
                              ROSIDL_GET_MSG_TYPE_SUPPORT(fastswing_msgs, msg, CurrentOverride),
                              "current_override", &overrides));
  link->wait_set = rcl_get_zero_initialized_wait_set();
  CHECK(rcl_wait_set_init(&link->wait_set, 1, 0, 0, 0, 0, 0, context, allocator));
  link->raw = rmw_get_zero_initialized_serialized_message();
  CHECK(rmw_serialized_message_init(&link->raw, 4096, &allocator));
}

int main(int argc, char **argv) {
  if (argc != 5) {
    fprintf(stderr, "usage: rcl_inhibit closed|open COUNT WARM_UP PERIOD_US < JOINTS\n");
    return 2;
  }
  int count = atoi(argv[2]), warm = atoi(argv[3]);
  int64_t period = atoi(argv[4]) * 1000LL;
  static Arm arm;
  read_arm(&arm);
  rcl_context_t context = rcl_get_zero_initialized_context();
  rcl_node_t node = rcl_get_zero_initialized_node();
  Link link = {.publisher = rcl_get_zero_initialized_publisher(),
               .subscription = rcl_get_zero_initialized_subscription()};
  open_link(&link, &context, &node);
  if (!until_armed(&arm, &link)) return 1;
  Tally tally = {.latency = malloc(sizeof(int64_t) * (count + 1))};
  if (strcmp(argv[1], "open"))
    run_closed(&arm, &link, &tally, count, warm, period);
  else
    run_open(&arm, &link, &tally, count, warm, period);
  print_tally(&tally);
  return 0;
}
