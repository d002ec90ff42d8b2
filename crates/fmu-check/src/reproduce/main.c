/* Seconds after which a phase counts as a hang. */
#ifndef PATIENCE
#define PATIENCE 20
#endif

/* Sets the paths for an FMU in this directory. In FMI 2.0, the location of the resources is a URI, in which most bytes are
   percent-encoded. */
static void locate(const char *directory) {
    char *to = resources;
    const char *at;
    snprintf(library_path, sizeof library_path, "%s/%s", directory, library_name);
    if (FMI == 3) { snprintf(resources, sizeof resources, "%s/resources/", directory); return; }
    to += sprintf(to, "file://");
    for (at = directory; *at && to < resources + sizeof resources - 20; at++) {
        bool plain = isalnum((unsigned char)*at) || strchr("/:-._~", *at);
        to += sprintf(to, plain ? "%c" : "%%%02X", (unsigned char)*at);
    }
    strcpy(to, "/resources");
}

/* Executes a phase. Each phase runs in a separate process, so that a crash does not end the main process. */
static void phase(int number, const char *directory) {
    char path[5100];
    locate(directory);
    if (places[number]) {
        snprintf(path, sizeof path, "%s/%s", scratch, places[number]);
        if (symlink(directory, path)) _exit(3);
        locate(path);
    }
    out = fdopen(dup(1), "w");
    setvbuf(out, NULL, _IOLBF, 0);
    snprintf(path, sizeof path, "%s/printed0", scratch);
    if (!freopen(path, "a", stdout)) _exit(3);
    alarm(PATIENCE);
    alarm_ends = (double)time(NULL) + PATIENCE;
    open_library();
    load();
    phases[number]();
    save();
    fflush(stdout);
    _exit(0);
}

/* Ends the adopted processes that are still alive after 0.3 s; returns whether there were any. */
static bool end_orphans(void) {
    bool found = false;
    struct dirent *entry;
    DIR *processes;
    if (waitpid(-1, NULL, WNOHANG) == -1) return false;
    usleep(300000);
    processes = opendir("/proc");
    while (processes && (entry = readdir(processes))) {
        char path[300], state;
        int pid, parent;
        FILE *file;
        snprintf(path, sizeof path, "/proc/%s/stat", entry->d_name);
        file = fopen(path, "r");
        if (!file) continue;
        if (fscanf(file, "%d (%*[^)]) %c %d", &pid, &state, &parent) == 3 && parent == getpid() && state != 'Z') {
            kill(pid, SIGKILL);
            found = true;
        }
        fclose(file);
    }
    if (processes) closedir(processes);
    return found;
}

/* Removes the directory for the results. */
static void remove_scratch(void) {
    struct dirent *entry;
    char path[5300];
    DIR *files = opendir(scratch);
    while (files && (entry = readdir(files))) {
        snprintf(path, sizeof path, "%s/%s", scratch, entry->d_name);
        unlink(path);
    }
    if (files) closedir(files);
    rmdir(scratch);
}

int main(int count, char **arguments) {
    char *full = realpath(count > 1 ? arguments[1] : ".", NULL), number[20], temporary[5000];
    const char *directory = getenv("TMPDIR");
    size_t i;
    int status;
    bool found;
    if (!full) { perror("the directory of the unpacked FMU"); return 3; }
    bind_now = EVIDENCE == END;
    if (count > 3) { scratch = arguments[3]; phase(atoi(arguments[2]), full); }
    snprintf(temporary, sizeof temporary, "%s/fmu-check-XXXXXX", directory && *directory ? directory : "/tmp");
    if (!mkdtemp(temporary)) { perror("mkdtemp"); return 3; }
    scratch = temporary;
#if defined(__linux__)
    prctl(PR_SET_CHILD_SUBREAPER, 1);
#endif
    for (i = 0; i < sizeof phases / sizeof *phases; i++) {
        pid_t child;
        char path[20];
        fflush(stdout);
        snprintf(number, sizeof number, "%zu", i);
        child = fork();
        if (child == 0) {
            setsid();
            /* Uninitialized memory differs between the processes, so that results that depend on it differ, too. */
            snprintf(path, sizeof path, "%zu", 1 + 90 * i);
            setenv("MALLOC_PERTURB_", path, 1);
            setenv("GLIBC_TUNABLES", "glibc.malloc.tcache_count=0", 1);
            execlp(arguments[0], arguments[0], full, number, scratch, (char *)NULL);
            perror(arguments[0]);
            _exit(3);
        }
        waitpid(child, &status, 0);
        if (WIFSIGNALED(status)) printf("the process was ended by signal %d (%s)\n", WTERMSIG(status), strsignal(WTERMSIG(status)));
        else if (WEXITSTATUS(status)) printf("the process ended with exit status %d\n", WEXITSTATUS(status));
        /* A crash or a hang shows that the FMU is faulty, even if the finding is another one. */
        if (status) { end_orphans(); remove_scratch(); return EVIDENCE == END || WIFSIGNALED(status) ? 1 : 3; }
    }
    found = end_orphans();
    if (EVIDENCE != ORPHANS) found = EVIDENCE == RESULTS && shows();
    remove_scratch();
    printf("%s\n", found ? "The finding is reproduced." : "The finding is not reproduced.");
    return EVIDENCE == NONE ? 3 : found;
}
