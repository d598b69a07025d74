"""What DJI aircraft leave: subtitles, records of images, tables of AirData."""
