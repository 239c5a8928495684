/* Replaces calls of the C library. The first call that the variables BEAMLET_GATE… name waits for the end of
 * a pipe (gate.rs). */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

static int has_passed;

static void wait_at_gate(void) {
    if (__atomic_exchange_n(&has_passed, 1, __ATOMIC_ACQ_REL)) return;
    int kept = errno;
    long pipe, got;
    char byte;
    do pipe = syscall(SYS_openat, AT_FDCWD, getenv("BEAMLET_GATE_PIPE"), O_RDONLY | O_CLOEXEC);
    while (pipe < 0 && errno == EINTR);
    do got = syscall(SYS_read, pipe, &byte, 1);
    while (got > 0 || (got < 0 && errno == EINTR));
    close(pipe);
    errno = kept;
}

/* Whether the gate is at this call on the file. */
static int is_here(const char *call, int file) {
    const char *gate = getenv("BEAMLET_GATE");
    if (!gate || strcmp(gate, call)) return 0;
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return strstr(path, getenv("BEAMLET_GATE_FILE")) != 0;
}

static int synced(long call, int file) {
    int failed = syscall(call, file);
    if (failed || !is_here("sync", file)) return failed;
    static char text[1 << 20];
    const char *wanted = getenv("BEAMLET_GATE_AT");
    ssize_t length = *wanted ? syscall(SYS_pread64, file, text, sizeof text - 1, 0L) : 0;
    if (length < 0) return failed;
    text[length] = 0;
    if (strstr(text, wanted)) wait_at_gate();
    return failed;
}

int fsync(int file) { return synced(SYS_fsync, file); }

int fdatasync(int file) { return synced(SYS_fdatasync, file); }

ssize_t write(int file, const void *from, size_t bytes) {
    if (is_here("write", file)) wait_at_gate();
    return syscall(SYS_write, file, from, bytes);
}

ssize_t read(int file, void *to, size_t bytes) {
    if (is_here("read", file) && lseek(file, 0, SEEK_CUR) >= atoll(getenv("BEAMLET_GATE_AT")))
        wait_at_gate();
    return syscall(SYS_read, file, to, bytes);
}
