/* A nearest-neighbour tracker: cc -O2 tracker.c -o tracker -lm && ./tracker RECORDING > tracks.csv
   It reads sensors, ego and detections in the order of columns of `testbed record --format csv`. */
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MOST = 500 };                            /* tracks at a time */
const double GATE = 5.0, INTO = 1.5;            /* [m] to detections; from the side that is seen to the centre */
static struct Track { int id, hits, missed, n; double x, y, vx, vy, sx, sy; } track[MOST];
static int count, last;

static FILE *table(const char *folder, const char *name, char *line, int size) {
    snprintf(line, size, "%s/%s.csv", folder, name);
    FILE *file = fopen(line, "r");
    if (!file) fprintf(stderr, "cannot read %s\n", line);
    return file && fgets(line, size, file) ? file : NULL;               /* without its header */
}

static void finish(double time, double dt) {    /* the scan is over: correct, report, forget */
    int kept = 0;
    for (struct Track *t = track; t < track + count; t++) {
        if (t->n) {
            double ex = t->sx / t->n - t->x, ey = t->sy / t->n - t->y;
            t->x += 0.5 * ex, t->y += 0.5 * ey, t->hits++, t->missed = 0;
            if (dt > 0) t->vx += 0.05 * ex / dt, t->vy += 0.02 * ey / dt;
        } else t->missed++;
        if (t->hits > 3 && t->missed < 3)
            printf("%.17g,%d,%f,%f,%f,%f,%f,4.6,1.9\n", time, t->id, t->x, t->y, atan2(t->vy, t->vx), t->vx, t->vy);
        t->n = 0, t->sx = t->sy = 0;
        if (t->missed < (t->hits < 4 ? 2 : 8)) track[kept++] = *t;
    }
    count = kept;
}

int main(int argc, char **argv) {
    static char line[9999], sensor[64], name[32][64];
    double mount[32][3], e[6] = {-INFINITY}, time = NAN, dt = 0, now, r, a, rate;  /* e: time, x, y, heading, vx, vy */
    int sensors = 0;
    FILE *sheet = table(argc > 1 ? argv[1] : ".", "sensors", line, sizeof line);
    FILE *way = table(argc > 1 ? argv[1] : ".", "ego", line, sizeof line);
    FILE *seen = table(argc > 1 ? argv[1] : ".", "detections", line, sizeof line);
    if (!sheet || !way || !seen) return 2;
    for (double *m; fgets(line, sizeof line, sheet) && sensors < 32; sensors++)
        m = mount[sensors], sscanf(line, "\"%63[^\"]\",%lf,%lf,%lf", name[sensors], m, m + 1, m + 2);
    puts("time,id,x,y,heading,vx,vy,length,width");
    while (fgets(line, sizeof line, seen)) {
        if (sscanf(line, "%lf,\"%63[^\"]\",%lf,%lf,%lf", &now, sensor, &r, &a, &rate) != 5) continue;
        if (now != time) {                      /* the first detection of a scan: predict, and move the ego */
            if (!isnan(time)) finish(time, dt), dt = now - time;
            for (int k = 0; k < count; k++) track[k].x += dt * track[k].vx, track[k].y += dt * track[k].vy;
            while (e[0] < now - 1e-6 && fgets(line, sizeof line, way))
                sscanf(line, "%lf,%lf,%lf,%lf,%lf,%lf", e, e + 1, e + 2, e + 3, e + 4, e + 5);
            time = now;
        }
        int s = 0, best = -1;
        while (s < sensors - 1 && strcmp(name[s], sensor)) s++;
        double c = cos(e[3]), d = sin(e[3]), ux = cos(e[3] + mount[s][2] + a), uy = sin(e[3] + mount[s][2] + a);
        double x = e[1] + c * mount[s][0] - d * mount[s][1] + (r + INTO) * ux, near = GATE;
        double y = e[2] + d * mount[s][0] + c * mount[s][1] + (r + INTO) * uy;
        for (int k = 0; k < count; k++)
            if (hypot(x - track[k].x, y - track[k].y) < near) near = hypot(x - track[k].x, y - track[k].y), best = k;
        double along = c * ux + d * uy, speed = (rate + e[4] * ux + e[5] * uy) / along;   /* over ground, on the road */
        if (best < 0 && count < MOST && fabs(along) > 0.5 && fabs(speed) > 2)
            track[best = count++] = (struct Track){++last, 0, 0, 0, x, y, c * speed, d * speed, 0, 0};
        if (best >= 0) track[best].n++, track[best].sx += x, track[best].sy += y;
    }
    if (!isnan(time)) finish(time, dt);
}
