"use strict";
// Each episode's videos run together, and jump to the time that is clicked in its plot.
for (const article of document.querySelectorAll("article")) {
  const videos = [...article.querySelectorAll("video")], plot = article.querySelector("svg.overlaps"), both = article.querySelector(".both");
  plot.addEventListener("click", (event) => {
    const box = plot.getBoundingClientRect(), seconds = (event.clientX - box.left) / box.width * Number(article.dataset.end);
    for (const video of videos) { video.pause(); video.currentTime = seconds; }
  });
  if (both) {
    both.addEventListener("click", () => {
      const playing = videos.some((video) => !video.paused), at = videos[0].ended ? Number(article.dataset.start) : videos[0].currentTime;
      for (const video of videos) { if (playing) video.pause(); else { video.currentTime = at; video.play(); } }
    });
  }
}
document.body.dataset.ready = "yes";
