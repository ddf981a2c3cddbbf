# The companion in a container, for linux/arm64 and linux/amd64: docs/install.md#in-a-container. It stands beside the
# Makefile because docker looks for it there, and because its sources are those of the whole tree.
#
#   docker build -t rover-companion .
#   docker buildx build --platform linux/arm64,linux/amd64 -t rover-companion .

FROM python:3.13-slim-bookworm AS wheel
WORKDIR /source
COPY pyproject.toml README.md LICENSE ./
COPY companion companion
COPY sitl sitl
COPY missions missions
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheel .

FROM python:3.13-slim-bookworm
COPY constraints.txt /
COPY --from=wheel /wheel /wheel
RUN pip install --no-cache-dir -c /constraints.txt "$(ls /wheel/rover_companion-*.whl)[web]" && rm -r /wheel

# A user of its own, in the group that may use serial ports (20 is dialout on Debian and Ubuntu).
RUN useradd --create-home --uid 1000 --groups dialout rover && install -d -o rover -g rover /data
USER rover
WORKDIR /data
# Mission, state and compiled kernels. The kernels are those of one kind of processor, so they are made at the first
# start on the rover, not in the image.
ENV CACHE_DIRECTORY=/data/cache STATE_DIRECTORY=/data/state PYTHONUNBUFFERED=1
VOLUME /data
ENTRYPOINT ["rover-companion"]
CMD ["run", "/data/mission.toml", "--connect", "tcp:127.0.0.1:5777", "--resume", "--web", "8421"]

# Of a BlueOS extension. The volume has a name, so that it belongs to the user above. A lidar wired to the computer needs
# "Devices" in HostConfig, with its serial port (docs/install.md); one that is missing keeps the container from starting.
ARG VERSION=0.1.0
ARG SOURCE_URL=https://example.org/rover-companion
LABEL version="${VERSION}"
LABEL type="device-integration"
LABEL requirements="core >= 1.1"
LABEL permissions='{\
  "HostConfig": {\
    "NetworkMode": "host",\
    "Binds": ["rover-companion-data:/data"]\
  }\
}'
LABEL authors='[{"name": "The rover-companion authors", "email": ""}]'
LABEL company='{"name": "The rover-companion authors", "about": "Finds the way of a rover through unknown ground", "email": ""}'
LABEL tags='["navigation", "rover", "autonomy", "mavlink"]'
LABEL readme="${SOURCE_URL}/raw/{tag}/docs/install.md"
LABEL links="{\"source\": \"${SOURCE_URL}\", \"documentation\": \"${SOURCE_URL}/blob/{tag}/README.md\"}"
