// The floor of a control loop: sleeps to absolute deadlines and exchanges UDP with an echo.
//
//     udp_pace echo PORT             answers until nothing came for 3 s
//     udp_pace loop PORT BYTES PERIOD_US COUNT
//
// The loop prints one line per period: begin, lateness of the wake-up, round trip (-1: no answer),
// all in nanoseconds, begin on CLOCK_MONOTONIC. With BYTES 0 it exchanges nothing.
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

static int64_t now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1000000000LL + t.tv_nsec;
}

static void sleep_until(int64_t deadline) {
  struct timespec t = {deadline / 1000000000LL, deadline % 1000000000LL};
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, 0) == EINTR) {
  }
}

static int echo(int s) {
  char frame[65536];
  struct sockaddr_in from;
  for (;;) {
    socklen_t size = sizeof from;
    ssize_t count = recvfrom(s, frame, sizeof frame, 0, (void *)&from, &size);
    if (count < 0) return 0;
    sendto(s, frame, count, 0, (void *)&from, size);
  }
}

static int loop(int s, size_t bytes, int64_t period, int count) {
  char *frame = calloc(1, 65536);
  int64_t(*seen)[3] = malloc(sizeof(int64_t[3]) * count);
  int64_t deadline = now();
  for (int i = 0; i < count; i++) {
    int64_t begin = now();
    seen[i][0] = begin;
    seen[i][1] = begin - deadline;
    ssize_t got = -1;
    if (bytes) {
      send(s, frame, bytes, 0);
      got = recv(s, frame, 65536, 0);
    }
    int64_t end = now();
    seen[i][2] = got < 0 ? -1 : end - begin;
    deadline += period;
    // As the bridge: a period that was missed is not caught up.
    if (end - deadline > period) deadline = end;
    if (deadline > end) sleep_until(deadline);
  }
  for (int i = 0; i < count; i++)
    printf("%lld %lld %lld\n", (long long)seen[i][0], (long long)seen[i][1],
           (long long)seen[i][2]);
  return 0;
}

int main(int argc, char **argv) {
  if (argc < 3) return 2;
  int echoes = !strcmp(argv[1], "echo");
  struct sockaddr_in address = {.sin_family = AF_INET,
                                .sin_port = htons(atoi(argv[2])),
                                .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
  int s = socket(AF_INET, SOCK_DGRAM, 0);
  struct timeval patience = {echoes ? 3 : 0, echoes ? 0 : 200000};
  setsockopt(s, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  if (echoes) return bind(s, (void *)&address, sizeof address) ? 1 : echo(s);
  if (argc < 6 || connect(s, (void *)&address, sizeof address)) return 2;
  prctl(PR_SET_TIMERSLACK, 1);
  return loop(s, strtoul(argv[3], 0, 10), atoll(argv[4]) * 1000, atoi(argv[5]));
}
