/* Each phase in a process of its own, so that a crash does not end this one. */
int main(int count, char **arguments) {
    char *full = realpath(count > 1 ? arguments[1] : ".", NULL), path[5000], number[20];
    char folder[] = "/tmp/fmu-check-XXXXXX";
    size_t i;
    int status;
    if (!full) { perror("the folder of the unpacked FMU"); return 3; }
    if (count > 3) {
        setvbuf(stdout, NULL, _IOLBF, 0);
        alarm(20);
        snprintf(resources, sizeof resources, resources_format, full);
        snprintf(path, sizeof path, "%s/%s", full, library_name);
        library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
        if (!library) { printf("%s\n", dlerror()); return 3; }
        load(arguments[3]);
        phases[atoi(arguments[2])]();
        save(arguments[3]);
        fflush(stdout);
        _exit(0);
    }
    if (!mkdtemp(folder)) { perror("mkdtemp"); return 3; }
    for (i = 0; i < sizeof phases / sizeof *phases; i++) {
        fflush(stdout);
        snprintf(number, sizeof number, "%zu", i);
        if (fork() == 0) {
            execlp(arguments[0], arguments[0], full, number, folder, (char *)NULL);
            perror(arguments[0]);
            _exit(3);
        }
        wait(&status);
        if (WIFSIGNALED(status)) {
            printf("\nthe process was ended by signal %d (%s)\n", WTERMSIG(status), strsignal(WTERMSIG(status)));
            return 1;
        }
        if (WEXITSTATUS(status)) { printf("\nthe process ended with exit status %d\n", WEXITSTATUS(status)); return 1; }
    }
    return 0;
}
