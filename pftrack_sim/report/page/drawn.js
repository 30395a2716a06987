"use strict";
// Plotly has been read: the plots, in the room that they have taken.
drawAll();
if (DRIVES.length) drawDrive();
for (const plot of document.querySelectorAll(".plot, .map")) plot.style.minHeight = "";
document.body.dataset.ready = "yes";
