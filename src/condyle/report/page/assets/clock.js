// One time cursor for everything on the page. It always stands on a sample.

const clockListeners = [];
const clock = { index: 0, playing: false, speed: 1 };
let playedAt = 0, playedFrom = 0;

function seek(index) {
  clock.index = Math.min(Math.max(Math.round(index), 0), samples - 1);
  if (clock.playing) restartPlay();
  announce();
}

function announce() {
  for (const listener of clockListeners) listener(clock.index);
}

function restartPlay() {
  playedAt = performance.now();
  playedFrom = time[clock.index];
}

function setPlaying(on) {
  if (on === clock.playing) return;
  if (on && clock.index === samples - 1) clock.index = 0;
  clock.playing = on;
  if (on) {
    restartPlay();
    requestAnimationFrame(tick);
  }
  announce();
}

function setSpeed(speed) {
  clock.speed = speed;
  restartPlay();
}

function tick(now) {
  if (!clock.playing) return;
  const t = playedFrom + Math.max(now - playedAt, 0) / 1000 * clock.speed;
  const index = sampleAt(Math.min(t, time[samples - 1]));
  if (t >= time[samples - 1]) clock.playing = false;
  if (index !== clock.index || !clock.playing) {
    clock.index = index;
    announce();
  }
  requestAnimationFrame(tick);
}
